"""What a page of HTML says, without its marks."""

import re
from html import unescape


def table_cells(html, name):
    """Give the rows of a table as lists of text."""
    found = re.search(rf'<table id="{name}".*?</table>', html, re.DOTALL)[0]
    rows = re.findall(r"<tr>(.*?)</tr>", found, re.DOTALL)
    return [
        [unescape(re.sub("<.*?>", "", c)).strip() for c in re.findall(r"<t[hd].*?</t[hd]>", row, re.S)] for row in rows
    ]
