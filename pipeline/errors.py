"""What can go wrong with an input, in words that help."""


class VideoError(Exception):
    """An input that cannot be read (on); the message names it, what is wrong and what to do.

    Attributes
    ----------
    path : str, the file or folder
    problem : str, the message without the path
    frame : int or None, how many frames from the start could be read and are usable
    """

    def __init__(self, path, problem: str, frame: int | None = None):
        self.path = str(path)
        self.problem = problem
        self.frame = frame
        super().__init__(f"{path}: {problem}")

    def __reduce__(self):
        """Travel between processes: Exception would pass the message as the only argument."""
        return type(self), (self.path, self.problem, self.frame)


class CorrectionsError(ValueError):
    """A corrections.csv that is no table of corrections; the message names file and line."""

    def __init__(self, problem: str):
        self.problem = problem
        super().__init__(f"{problem}; correct the file, or delete it")

    def __reduce__(self):
        """Travel between processes without the advice being added again."""
        return type(self), (self.problem,)


class InputError(ValueError):
    """Unusable arguments; the message names them and says what to do."""
