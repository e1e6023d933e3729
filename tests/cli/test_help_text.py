from midair.cli.help_text import epilogue, examples_of


def does(source: str) -> None:
    """Do it.

    Parameters
    ----------
    source
        $ not an example.

    Examples
    --------
    $ midair do take.h5
    $ midair do "a b"
    """


def test_examples_are_the_lines_with_a_prompt_of_their_section():
    assert examples_of(does) == ("midair do take.h5", 'midair do "a b"')
    assert examples_of(lambda: None) == ()


def test_a_long_example_is_broken_as_a_shell_takes_it():
    long = "midair do " + " ".join(f"--option-{n} value" for n in range(6))
    shown = epilogue((long,))
    assert shown.startswith("Example:\n  midair do")
    assert max(map(len, shown.splitlines())) <= 80
    assert " ".join(shown.split("\n\n")[0].split("\n", 1)[1].replace("\\\n", "").split()) == long
