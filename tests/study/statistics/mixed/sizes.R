# R 4.2.2, lme4: what test_mixed.py compares with. Six people, 48 to 1000 trials each; one level a person by adaptive
# quadrature with 25 nodes, and people who differ in every effect by Laplace's approximation.
suppressMessages(library(lme4))
all <- read.csv("sizes.csv"); out <- NULL
for (k in c("participant", "surface", "object")) all[[k]] <- factor(all[[k]])
contrasts(all$surface) <- contr.sum(2); contrasts(all$object) <- contr.sum(3)
fit <- function(d, X, random, nodes) {
  e <- as.data.frame(X); names(e) <- paste0("x", seq_len(ncol(X))); terms <- paste(names(e), collapse = "+")
  e <- cbind(e, d)
  suppressMessages(suppressWarnings(glmer(as.formula(paste("cbind(right, total - right) ~ 0 +", terms, "+", random)), e,
    family = binomial, nAGQ = nodes, control = glmerControl(optimizer = "bobyqa", tolPwrss = 1e-12, optCtrl = list(maxfun = 1e5)))))
}
levels_only <- "(1|participant)"
slopes <- "(1|participant) + (1|participant:surface) + (1|participant:object) + (1|participant:surface:object)"
for (size in unique(all$trials)) for (model in c("levels", "slopes")) {
  d <- all[all$trials == size, ]; X <- model.matrix(~ surface * object, d); a <- attr(X, "assign")
  random <- if (model == "levels") levels_only else slopes; nodes <- if (model == "levels") 25 else 1
  full <- fit(d, X, random, nodes); v <- as.data.frame(VarCorr(full))
  sd <- v$sdcor[match(c("participant", "participant:surface", "participant:object", "participant:surface:object"), v$grp)]
  chi <- sapply(1:3, function(i) as.numeric(2 * (logLik(full) - logLik(fit(d, X[, a != i], random, nodes)))))
  out <- rbind(out, data.frame(trials = size, model = model, sd_person = sd[1], sd_surface = sd[2], sd_object = sd[3],
    sd_both = sd[4], surface = chi[1], object = chi[2], both = chi[3]))
}
write.csv(format(out, digits = 10), "sizes_r.csv", row.names = FALSE, quote = FALSE)
