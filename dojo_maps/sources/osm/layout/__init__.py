"""Where arms end, crossings lie and pavements run."""
