from types import SimpleNamespace

import numpy as np
import pytest

from twin.validation.fitting import fitted_rows


@pytest.mark.parametrize(("equal", "counts"), [(False, [80, 20, 0]), (True, [20, 20, 0])])
def test_files_count_equally_in_a_fit(equal, counts):
    """The third file is left out, as by a fold: it neither counts nor sets the number of rows."""
    own = SimpleNamespace(keys=SimpleNamespace(equal_files=equal))
    data = SimpleNamespace(file_index=np.repeat([0, 1, 2], [80, 20, 5]))
    rows = data.file_index < 2
    counted = fitted_rows(own, data, rows)
    assert np.bincount(data.file_index[counted], minlength=3).tolist() == counts
    assert not np.any(counted & ~rows)
