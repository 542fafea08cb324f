"""Making of an archive with checkpoints: a new start resumes an earlier one."""
