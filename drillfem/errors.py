"""What drillfem raises on purpose. The command line turns each into one line and an exit code."""


class DrillfemError(Exception):
    """Anything that drillfem reports instead of failing with a traceback."""


class SceneError(DrillfemError):
    """The input is wrong: one line that names the key, its value and what is allowed. Exit code 2."""


class SimulationError(DrillfemError):
    """The simulation failed; what was computed until then is kept. Exit code 1."""


class MissingDependency(DrillfemError):
    """Something that is not installed is needed; the message says how to get it. Exit code 1."""
