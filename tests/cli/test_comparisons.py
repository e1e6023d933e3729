from midair.cli.comparisons import print_palm
from midair.evaluate import PalmFidelity


def test_palm_fidelity_is_printed_for_each_skin(capsys):
    skins = {"soft": 15.04, "stiff": 20.0}
    print_palm(PalmFidelity(outside=0.0312, pressure=12.34, square=17.0, displacement=skins, palm="mine"))
    said = " ".join(capsys.readouterr().out.split())
    assert "fidelity on a whole palm, mine" in said
    assert "3.12 % of the power in the band" in said
    assert "pressure 12.3 dB over the palm, 17.0 dB within the square" in said
    assert "displacement 15.0 dB (soft), 20.0 dB (stiff)" in said
    assert "not measured on people" in said
