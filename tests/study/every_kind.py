"""A study with every kind of stimulus and question, for a session in a browser."""

QUESTIONS = {  # kind: further lines
    "yes-no": "",
    "slider": "low = 0\nhigh = 100\nlow_label = 'smooth'\nhigh_label = 'rough'",
    "rating": "low_label = 'weak'\nhigh_label = 'strong'",
    "magnitude": "",
    "choice": "options = ['first', 'second']\ntruth = 'interval'",
    "same-different": "",
    "text": "",
}
"""Kinds of questions; the pairs are compared by the choice and by same or different."""

STIMULI = {  # name: lines
    "touch": "source = 'weak.drive.h5'\nmade_from = 'virtual:towel'\nshare = 0.5\nlevels = { strength = '50' }",
    "nothing": "kind = 'silence'\nlevels = { strength = '0' }",
    "object": "kind = 'object'\nsource = 'towel'",
    "word": "kind = 'text'\nsource = 'sandpaper'\nduration_s = 0.3",
    "pair": "kind = 'pair'\nmembers = ['touch', 'nothing']\neither_order = 'interval'",
    "mixed": "kind = 'pair'\nmembers = ['word', 'touch']",
    "photo": "kind = 'picture'\nsource = 'photo.png'",
    "noise": "kind = 'sound'\nsource = 'noise.wav'",
}


def plan_text() -> str:
    single = [name for name in STIMULI if name not in ("pair", "mixed")]
    head = "name = 'kinds'\nparticipants = 1\nseed = 1\nconsent = 'You may stop at any time.'\nform = ['text']\n"
    questions = [
        f"[[questions]]\nname = '{kind}'\nkind = '{kind}'\ntext = 'Question {kind}?'\n{more}\n"
        for kind, more in QUESTIONS.items()
    ]
    named = [f"[[stimuli]]\nname = '{name}'\n{lines}\n" for name, lines in STIMULI.items()]
    blocks = [
        f"[[blocks]]\nname = '{name}'\nstimuli = {which}\nquestions = {asked}\norder = 'fixed'\n"
        for name, which, asked in (
            ("single", single, ["yes-no", "slider", "rating", "magnitude"]),
            ("pairs", ["pair"], ["choice"]),
            ("mixed", ["mixed"], ["same-different"]),
        )
    ]
    return "\n".join([head, *questions, *named, *blocks])
