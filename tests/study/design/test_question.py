from midair.study.design.question import Question

CHOICE = Question(name="which", kind="choice", text="?", options=("brush", "sponge", "spoon", "7"))
TWO = Question(name="n", kind="choice", text="?", options=("2", "3", "4"))
SIZES = Question(name="mm", kind="choice", text="?", options=("3 mm", "1 mm", "20 mm"))
ORDER = Question(name="o", kind="choice", text="?", options=("1st", "2nd"))
SLIDE = Question(name="s", kind="slider", text="?", low=0, high=100)
WORDS = Question(name="w", kind="text", text="?")
RATING = Question(name="like", kind="rating", text="?", low=-1, high=3)
MAGNITUDE = Question(name="size", kind="magnitude", text="?")
FELT = Question(name="felt", kind="yes-no", text="?")
SAME = Question(name="same", kind="same-different", text="?")


def test_typed_text_is_stored_as_the_answer():
    for question, said, stored in [
        (CHOICE, " sponge ", "sponge"),
        (CHOICE, "2", "sponge"),
        (CHOICE, "BR", "brush"),
        (CHOICE, "7", "7"),  # an option before the number of one
        (TWO, "2", "2"),  # the option, not the second one
        (TWO, "4", "4"),
        (SIZES, "1 m", "1 mm"),
        (ORDER, "2", "2nd"),
        (SLIDE, "12.50", "12.5"),
        (SLIDE, "100", "100"),
        (WORDS, "  a\tsoft cloth ", "a soft cloth"),
        (WORDS, "", ""),
        (RATING, "-1", "-1"),
        (RATING, "3", "3"),
        (MAGNITUDE, "12.50", "12.5"),
        (MAGNITUDE, "0", "0"),
        (FELT, "y", "yes"),
        (FELT, "2", "no"),
        (SAME, "diff", "different"),
    ]:
        assert question.read(said) == stored, said
    for question in (CHOICE, RATING, FELT, SAME, TWO, SIZES, ORDER):
        assert [question.read(answer) for answer in question.answers] == list(question.answers)
    assert (RATING.answers, MAGNITUDE.answers) == (("-1", "0", "1", "2", "3"), ())


def test_one_key_stands_for_one_answer():
    assert CHOICE.keys == {"1": "brush", "2": "sponge", "3": "spoon", "4": "7"}
    assert (TWO.keys, FELT.keys) == ({"2": "2", "3": "3", "4": "4"}, {"1": "yes", "2": "no"})
    assert [one.keys for one in (SIZES, SLIDE, WORDS, RATING)] == [{}] * 4
    for question in (CHOICE, TWO, FELT, SAME, ORDER):
        assert {key: question.read(key) for key in question.keys if question is not CHOICE or key != "7"} == dict(
            question.keys
        )
