# R 4.2.2, lme4, BayesFactor 0.9.12: the numbers in test_mixed.py and test_compare.py.
suppressMessages({library(lme4); library(BayesFactor)}); options(digits = 12)
d <- read.csv("choices.csv"); for (k in 1:3) d[[k]] <- factor(d[[k]])
contrasts(d$surface) <- contr.sum(2); contrasts(d$object) <- contr.sum(3)
X <- model.matrix(~ surface * object, d); a <- attr(X, "assign")
fit <- function(X) {
  e <- as.data.frame(X); e$y <- d$correct; e$participant <- d$participant; names(e) <- make.names(names(e))
  terms <- paste(setdiff(names(e), c("y", "participant")), collapse = "+")
  glmer(as.formula(paste("y ~ 0 +", terms, "+ (1|participant)")), e, family = binomial, nAGQ = 25,
        control = glmerControl(optimizer = "bobyqa", tolPwrss = 1e-12))
}
full <- fit(X); cat("sd", attr(VarCorr(full)$participant, "stddev"), "intercept", fixef(full)[1], "\n")
for (i in 1:3) {
  chi <- as.numeric(2 * (logLik(full) - logLik(fit(X[, a != i]))))
  cat(i, sum(a == i), chi, pchisq(chi, sum(a == i), lower = FALSE), "\n")
}
for (x in list(c(1.6, 3), c(2.5, 10), c(0.3, 20), c(6, 10)))
  cat(x, exp(ttest.tstat(x[1], x[2], rscale = sqrt(2) / 2)$bf), "\n")
