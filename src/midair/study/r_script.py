"""R script beside an exported table: analysis of variance, mixed models and thresholds by packages of R."""

import re
from collections.abc import Sequence

from midair.study.design.study_design import Design
from midair.version import __version__

_HEAD = """\
# Analyses of TABLE in R, written by midair VERSION from the plan of the study.
# Run it with `Rscript SCRIPT`. It needs, as far as the plan asks for them, the packages lme4, ordinal, afex, quickpsy.
file <- sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE))
folder <- if (length(file)) dirname(file[1]) else "."
d <- read.csv(file.path(folder, "TABLE"), na.strings = "n/a", colClasses = c(answer = "character"))
d <- d[d$scored == "true", ]  # without familiarisation, checks and what the plan excludes

has <- function(package) {
  there <- requireNamespace(package, quietly = TRUE)
  if (!there) message("not fitted: install.packages(\\"", package, "\\")")
  there
}

# Type III likelihood-ratio test of each effect. Random effects: participants, participants x each effect (not the
# highest interaction if no participant has a cell twice), and the factors in `crossed`, such as "stimulus", whose
# levels are a sample of many. F and p account for the number of participants; use p_chi2 with `crossed`.
mixed <- function(d, answer, within, crossed = NULL) {
  two <- length(unique(d[[answer]])) == 2
  if (!has(if (two) "lme4" else "ordinal")) return(invisible(NULL))
  for (f in c("participant", within, crossed)) d[[f]] <- droplevels(factor(d[[f]]))
  for (w in within) contrasts(d[[w]]) <- contr.sum(nlevels(d[[w]]))
  formula <- reformulate(paste(within, collapse = "*"))
  X <- model.matrix(formula, d)
  term <- attr(X, "assign")
  colnames(X) <- paste0("x", seq_len(ncol(X)))
  effects <- attr(terms(formula), "term.labels")
  twice <- any(duplicated(d[c("participant", within)])) || length(effects) == 1
  random <- c("participant", paste0("participant:", if (twice) effects else head(effects, -1)), crossed)
  d <- cbind(d, X)
  d$y <- if (two) as.integer(factor(d[[answer]])) - 1L else ordered(as.numeric(d[[answer]]))
  fit <- function(keep) {
    model <- reformulate(c("1", colnames(X)[keep & term > 0], sprintf("(1|%s)", random)), "y")
    if (!two) return(ordinal::clmm(model, data = d, control = ordinal::clmm.control(method = "nlminb", gradTol = 1e-6)))
    lme4::glmer(model, d, family = binomial,
      control = lme4::glmerControl(optimizer = "bobyqa", tolPwrss = 1e-12, optCtrl = list(maxfun = 1e5)))
  }
  whole <- fit(term >= 0)
  n <- nlevels(d$participant)
  rows <- lapply(seq_along(effects), function(i) {
    chi2 <- max(2 * as.numeric(logLik(whole) - logLik(fit(term != i))), 0)
    df <- sum(term == i)
    F <- (n - 1) * expm1(chi2 / (n * df))
    data.frame(effect = effects[i], df = df, chi2 = chi2, p_chi2 = pchisq(chi2, df, lower.tail = FALSE),
      F = F, df2 = df * (n - 1), p = pf(F, df, df * (n - 1), lower.tail = FALSE))
  })
  table <- do.call(rbind, rows)
  table$p_Holm <- p.adjust(table$p, "holm")
  print(table, digits = 6, row.names = FALSE)
  print(spread(whole))
}

# Standard deviation of each random effect, in logits.
spread <- function(fit) {
  v <- if (inherits(fit, "clmm")) ordinal::VarCorr(fit) else lme4::VarCorr(fit)
  round(sapply(v, function(one) attr(one, "stddev")[[1]]), 4)
}

# Threshold of each participant: logistic function of the logarithm of the level, with the lapse rate estimated.
threshold <- function(d, level, guess) {
  if (!has("quickpsy")) return(invisible(NULL))
  d <- d[!is.na(d[[level]]) & d$correct >= 0, ]
  d <- data.frame(participant = d$participant, level = as.numeric(d[[level]]), right = d$correct)
  d <- d[d$level > 0, ]
  for (one in split(d, d$participant)) {
    found <- quickpsy::quickpsy(one, level, right, log = TRUE, fun = quickpsy::logistic_fun, guess = guess,
      lapses = TRUE)
    print(cbind(participant = one$participant[1], as.data.frame(found$thresholds)))
  }
}
"""


def script_of_plan(design: Design, *, table: str, script: str) -> str:
    """Text of an R script that analyses the exported table of a study.

    `table` and `script` are the file names of the table, which `write_csv` wrote beside it, and of the script.
    """
    parts = [_HEAD.replace("TABLE", table).replace("VERSION", __version__).replace("SCRIPT", script)]
    analysis = design.analysis
    if analysis.choice:
        truth = design.question(analysis.choice).truth
        within = [name for name in (truth, analysis.condition) if name]
        chosen = [f"d$question == {_text(analysis.choice)}", "d$correct >= 0"]
        chosen += [f"d[[{_text(_column(name))}]] == {_text(level)}" for name, level in analysis.only.items()]
        parts.append(
            _section("Correct answers: logistic mixed model", chosen, f'mixed(part, "correct", {_names(within)})')
        )
    if analysis.rated and analysis.within:
        chosen = [f"d$question %in% {_names(analysis.rated, column=False)}"]
        chosen += [f"d[[{_text(_column(name))}]] == {_text(level)}" for name, level in analysis.only.items()]
        within, between = _names(analysis.within), _names(analysis.between) if analysis.between else "NULL"
        parts.append(
            _section(
                "Ratings: analysis of variance, and cumulative-link mixed model",
                chosen,
                "part$answer <- as.numeric(part$answer)\n"
                f'if (has("afex")) print(afex::aov_ez("participant", "answer", part, within = {within}, '
                f"between = {between},\n"
                '  fun_aggregate = mean, anova_table = list(correction = "GG", es = c("pes", "ges"))))\n'
                f'mixed(part, "answer", {within})',
            )
        )
    for block in design.blocks:
        if block.strength and block.scored:
            question = design.question(block.questions[0])
            guess = "TRUE" if question.kind == "yes-no" else f"1 / {max(len(question.answers), 2)}"
            chosen = [f"d$block == {_text(block.name)}", f"d$question == {_text(question.name)}"]
            level = _text(_column(block.strength))
            parts.append(_section(f"Thresholds of {block.name}", chosen, f"threshold(part, {level}, guess = {guess})"))
    return "\n".join(parts)


def _section(title: str, chosen: Sequence[str], code: str) -> str:
    return f'cat("\\n{title}\\n")\npart <- d[which({" & ".join(chosen)}), ]\n{code}\n'


def _column(name: str) -> str:
    """Name that R gives to a column."""
    return re.sub(r"[^A-Za-z0-9._]", ".", name)


def _text(words: str) -> str:
    """A string of R."""
    return '"' + words.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _names(names: Sequence[str], *, column: bool = True) -> str:
    """A vector of strings of R."""
    return f"c({', '.join(_text(_column(name) if column else name) for name in names)})"
