"""Settings in YAML, also from untrusted files (extra `train`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from billiards_env.support.files import read_text, refusing

_MOST_BYTES = 100_000  # of a file, which has about 1000


def read_settings(path: Path, what: str) -> Any:
    """Returns the data of a YAML file without aliases.

    A few lines with aliases can stand for gigabytes of data.

    Args:
        path: The file.
        what: What the file should hold, for the messages.

    Raises:
        OSError: As in `read_text`.
        ValueError: As in `read_text`, or if the text is not YAML, has an alias, or is nested too deeply.
    """
    text = read_text(path, _MOST_BYTES, what)
    with refusing(path, what):
        if text.count("[") + text.count("{") > 1000:  # the time to read nested lists grows with the square of the depth
            raise ValueError("more than 1000 lists and mappings in brackets")
        try:
            for event in yaml.parse(text, yaml.SafeLoader):
                if isinstance(event, yaml.AliasEvent):
                    raise yaml.MarkedYAMLError(problem=f"an alias, *{event.anchor}", problem_mark=event.start_mark)
            return yaml.safe_load(text)
        except yaml.MarkedYAMLError as error:
            where = "" if error.problem_mark is None else f"line {error.problem_mark.line + 1}: "
            raise ValueError(f"{where}{error.problem}") from None
        except RecursionError:
            raise ValueError("nested too deeply") from None
