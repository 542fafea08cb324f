"""Text of a first study of a user's own model, with comments on what is left to fill in."""
