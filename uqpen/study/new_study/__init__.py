"""Text of a first study of a user-defined model, with comments on what is left to fill in."""
