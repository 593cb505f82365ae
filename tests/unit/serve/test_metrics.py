"""The numbers of several boards on one page, in both formats, as a parser of others reads them."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest
from prometheus_client.metrics_core import Metric
from prometheus_client.openmetrics.parser import text_string_to_metric_families as open_metrics
from prometheus_client.parser import text_string_to_metric_families as plain

from vbus.serve.metrics import exposition

URL = 'unix:/tmp/a "b"\\c\nd'


def status(board: str) -> dict[str, Any]:
    """Return what a board tells of itself, as far as it is on the page."""
    return {
        "board": board, "policy": "realtime", "rate": 1.0,
        "links": [{"url": URL, "sessions": 1, "served": 3, "received": 10, "sent": 20}],
        "chips": [{"name": "x", "reads": 5, "writes": 2}],
        "violations": {"lm628.T14": 2},
        "time_ps": 5 * 10**11, "time_left_ps": 10**18, "slipped_ps": 0, "overload": 0.0,
        "worst_lag_ps": 7,
        "lag": {"count": 3, "sum_ps": 10**6, "bounds_ps": [10**6, 2 * 10**6], "buckets": [1, 1, 1]},
        "round_trips": {"count": 2, "sum_ns": 1000, "bounds_ns": [1000], "buckets": [1, 1]},
    }  # fmt: skip


@pytest.mark.parametrize(("read", "is_open"), [(plain, False), (open_metrics, True)])
def test_boards_share_a_page_and_labels_may_say_anything(
    read: Callable[[str], Iterable[Metric]], is_open: bool
) -> None:
    lines = exposition([status("a"), status('b"')], is_open)
    families = list(read("\n".join((*lines, ""))))
    assert len({family.name for family in families}) == len(families) == 13
    found = {
        (one.name, *(one.labels[key] for key in sorted(one.labels))): one.value
        for family in families
        for one in family.samples
    }
    for board in ("a", 'b"'):
        assert found["vbus_link_bytes_total", board, "sent", f"0:{URL}"] == 20
        assert found["vbus_chip_time_seconds_total", board] == 0.5
        assert [
            found["vbus_lag_seconds_bucket", board, bound] for bound in ("1e-06", "2e-06", "+Inf")
        ] == [1, 2, 3]
        assert found["vbus_lag_seconds_sum", board] == 1e-6
