"""The data of the page of a shot."""

import json
import re

from billiards_env.drawing.page import make_page
from billiards_env.drawing.recording import recording_of


def page_data(shot):
    """Returns the data in the page of a recorded shot; JSON has no infinities."""
    (text,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', make_page(recording_of(shot)))
    return json.loads(text, parse_constant=int)
