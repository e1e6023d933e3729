import numpy as np
import pytest
import soundfile

from midair.errors import BrokenFileError
from midair.files.importers.riff import CHUNK, append_chunk, chunks, content


@pytest.mark.parametrize("text", [b"", b"x", b"even", b"odd", b"x" * 300_000])
@pytest.mark.parametrize("frames", [2, 3])
def test_a_chunk_is_read_back_and_ignored_by_other_programs(text, frames, tmp_path):
    path = tmp_path / "a.wav"
    soundfile.write(path, np.arange(frames) / 8, 8000, subtype="PCM_U8", format="WAV")
    append_chunk(path, text)
    found = [content(path, chunk) for chunk in chunks(path) if chunk.letters == CHUNK]
    assert found == [text]
    np.testing.assert_array_equal(soundfile.read(path)[0], np.arange(frames) / 8)
    assert int.from_bytes(path.read_bytes()[4:8], "little") == path.stat().st_size - 8


@pytest.mark.parametrize("data", [b"RIFX\0\0\0\0WAVE", b"RIFF\0\0\0\0AVI ", b"RI"])
def test_refuses_other_files_than_wav(data, tmp_path):
    (tmp_path / "a.wav").write_bytes(data)
    with pytest.raises(BrokenFileError, match="expected a WAV"):
        chunks(tmp_path / "a.wav")
