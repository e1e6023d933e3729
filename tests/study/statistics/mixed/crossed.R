# Made-up answers and R's models of them, for test_cumulative.py: R 4.2.2, lme4 1.1-31, ordinal 2022.11-16.
suppressMessages({library(lme4); library(ordinal)}); set.seed(7)
person <- function(n) sprintf("p%02d", seq_len(n)); normal <- function(k, sd) rnorm(length(unique(k)), sd = sd)[match(k, unique(k))]
cut_at <- function(x, at) 1 + findInterval(x, at)
full <- function(n, ...) expand.grid(c(rev(list(...)), list(participant = person(n))), stringsAsFactors = FALSE)
save <- function(d, name) { write.csv(d[c("participant", setdiff(rev(names(d)), "participant"))], paste0(name, ".csv"), row.names = FALSE, quote = FALSE); invisible(d) }
S <- c("plain", "grooved"); O <- c("brush", "sponge", "towel")
d <- full(12, item = paste0("i", 1:15)); d$surface <- S[1 + (as.integer(sub("i", "", d$item)) + as.integer(sub("p", "", d$participant))) %% 2]
d$score <- rbinom(nrow(d), 1, plogis(.3 + .8 * (d$surface == "plain") + normal(d$participant, .7) + normal(d$item, .9))); save(d, "items")
d <- full(18, surface = S, object = O, item = paste0("i", 1:4))
d$score <- rbinom(nrow(d), 1, plogis(-.2 + (d$object == "towel") + normal(d$participant, 1) + normal(d$item, .5))); save(d, "items_two_way")
d <- full(10, surface = S, object = O); d$score <- cut_at((d$surface == "plain") + 1.5 * (d$object == "towel") + normal(d$participant, 1) + rlogis(nrow(d)), -2:3 * .8); save(d, "seven_points")
d <- full(14, object = O, item = paste0("i", 1:6)); d$score <- cut_at(.9 * (d$object == "brush") + normal(d$participant, 1.2) + normal(d$item, .8) + rlogis(nrow(d)), c(-1, 0, 1.5)); save(d, "four_points_items")
d <- full(9, surface = S, object = O, repetition = 1:3); d$score <- cut_at(normal(d$participant, .8) + normal(paste(d$participant, d$object), 1) + rlogis(nrow(d)), c(-1.5, -.3, .6, 2)); save(d[names(d) != "repetition"], "five_points_slopes")

out <- NULL
model <- function(name, within, random) {
  d <- read.csv(paste0(name, ".csv"), stringsAsFactors = TRUE); for (w in within) contrasts(d[[w]]) <- contr.sum(nlevels(d[[w]]))
  X <- model.matrix(reformulate(paste(within, collapse = "*")), d); a <- attr(X, "assign"); colnames(X) <- paste0("x", seq_len(ncol(X))); e <- cbind(d, X)
  two <- length(unique(d$score)) == 2; if (!two) e$score <- ordered(e$score)
  fit <- function(keep) {
    f <- reformulate(c("1", colnames(X)[keep & a > 0], sprintf("(1|%s)", random)), "score")
    if (two) glmer(f, e, family = binomial, control = glmerControl(optimizer = "bobyqa", tolPwrss = 1e-12, optCtrl = list(maxfun = 1e5)))
    else clmm(f, data = e, control = clmm.control(method = "nlminb", gradTol = 1e-6))
  }
  whole <- fit(a >= 0); v <- VarCorr(whole); sd <- sapply(random, function(r) attr(v[[r]], "stddev")[[1]])
  add <- function(what, value) out <<- rbind(out, data.frame(design = name, what = what, value = signif(value, 9)))
  add("log_likelihood", as.numeric(logLik(whole))); for (r in random) add(paste0("sd ", r), sd[[r]])
  for (i in seq_len(max(a))) add(paste0("chi2 ", attr(terms(reformulate(paste(within, collapse = "*"))), "term.labels")[i]), as.numeric(2 * (logLik(whole) - logLik(fit(a != i)))))
}
model("items", "surface", c("participant", "item"))
model("items_two_way", c("surface", "object"), c("participant", "item"))
model("seven_points", c("surface", "object"), c("participant", "participant:surface", "participant:object"))
model("four_points_items", "object", c("participant", "item"))
model("five_points_slopes", c("surface", "object"), c("participant", "participant:surface", "participant:object", "participant:surface:object"))
write.csv(out, "crossed_r.csv", row.names = FALSE, quote = FALSE)
