"""Settings in YAML that may come from others (extra `train`)."""

from __future__ import annotations

from typing import Any

import yaml


def plain_yaml(text: str) -> Any:
    """Returns the data of a YAML text without aliases.

    A few lines with aliases can stand for gigabytes of data.

    Raises:
        yaml.YAMLError: If the text is not YAML, has an alias, or is nested too deeply.
    """
    if text.count("[") + text.count("{") > 1000:  # the time to read nested lists grows with the square of the depth
        raise yaml.YAMLError("more than 1000 lists and mappings in brackets")
    try:
        for event in yaml.parse(text, yaml.SafeLoader):
            if isinstance(event, yaml.AliasEvent):
                raise yaml.MarkedYAMLError(problem=f"an alias, *{event.anchor}", problem_mark=event.start_mark)
        return yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        where = "" if error.problem_mark is None else f"line {error.problem_mark.line + 1}: "
        raise yaml.YAMLError(f"{where}{error.problem}") from None
    except RecursionError:
        raise yaml.YAMLError("nested too deeply") from None
