"""The exception for mistakes that a user can mend."""


class UserError(Exception):
    """A mistake in the user's input: one line that says which file, where, and how to mend it (exit status 2)."""
