import gzip

from starlette.requests import Request

from midair.studio.application import WebFiles


def asked(*headers):
    return Request({"type": "http", "headers": list(headers)})


def test_file_is_compressed_only_for_browsers_that_accept_gzip(tmp_path):
    (tmp_path / "a.js").write_text("let a = 1;\n" * 50)
    (tmp_path / "secret.key").write_text("secret")
    files = WebFiles.of([tmp_path])
    plain = files.answer(asked(), "a.js")
    packed = files.answer(asked((b"accept-encoding", b"gzip, deflate, br")), "a.js")
    assert plain.media_type == "text/javascript"
    assert packed.headers["content-encoding"] == "gzip"
    assert len(packed.body) < 0.3 * len(plain.body)
    assert gzip.decompress(packed.body) == plain.body
    assert packed.headers["vary"] == plain.headers["vary"] == "accept-encoding"
    for name in ("secret.key", "../a.js", "b.js", ""):
        assert files.answer(asked(), name).status_code == 404


def test_compression_is_deterministic(tmp_path):
    (tmp_path / "a.css").write_text("a { color: red }")
    assert WebFiles.of([tmp_path]) == WebFiles.of([tmp_path])
