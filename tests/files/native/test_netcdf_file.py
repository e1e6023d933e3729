"""NetCDF: content as read by the netCDF library and xarray."""

import numpy as np
import pytest
import xarray

from midair.files import save
from midair.files.native.schema import NETCDF


@pytest.fixture
def path(recording, calibration, tmp_path):
    assert save(recording, tmp_path / "a.nc", calibration=calibration) == ()
    return tmp_path / "a.nc"


def test_xarray_finds_axes_units_and_conventions(path, recording):
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data["samples"].dims == ("time", "row", "column")
        assert data["samples"].attrs["units"] == "Pa"
        np.testing.assert_array_equal(data["samples"], recording.samples)
        np.testing.assert_allclose(data["time"], recording.time)
        assert data["time"].attrs["units"] == "s"
        assert {entry.name for entry in NETCDF} <= set(data.attrs)
        assert data.attrs["source"].endswith("(SIMULATED)")
        assert data.attrs["history"] == "record"


def test_the_netcdf_library_reads_it(path, recording):
    library = pytest.importorskip("netCDF4")
    with library.Dataset(path) as data:
        assert data.data_model == "NETCDF4"
        assert {name: len(axis) for name, axis in data.dimensions.items()} == {"time": 40, "row": 3, "column": 5}
        np.testing.assert_array_equal(data["samples"][:], recording.samples)
        assert data["calibration"]["response_real"].units == "V/Pa"
