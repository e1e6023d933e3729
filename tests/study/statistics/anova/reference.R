suppressMessages({library(afex); library(emmeans)}); options(digits = 15)
# Limits of a noncentrality by inversion of R's pt and pf; effectsize uses the same with a less exact search.
root <- function(f, ends) uniroot(f, ends, tol = 1e-12, extendInt = "yes")$root
limits_t <- function(t, df) sapply(c(.975, .025), function(p) root(function(ncp) pt(t, df, ncp) - p, t + c(-1, 1)))
limits_np2 <- function(f, df1, df2) sapply(c(.95, .05), function(p) {
  ncp <- if (pf(f, df1, df2) < p) 0 else root(function(x) pf(f, df1, df2, pmax(0, x)) - p, c(0, 4 * df1 * f + 9)); ncp / (ncp + df2)
})
table <- function(d, form) {
  d$participant <- factor(d$participant)
  fit <- function(es) suppressWarnings(suppressMessages(aov_car(form, data = d, anova_table = list(correction = "none", es = es))))
  a <- fit("ges"); s <- suppressWarnings(summary(a)); t <- a$anova_table
  adj <- s$pval.adjustments; sph <- s$sphericity.tests
  out <- data.frame(effect = rownames(t), df1 = t[["num Df"]], df2 = t[["den Df"]], F = t[["F"]], p = t[["Pr(>F)"]],
                    np2 = fit("pes")$anova_table$pes, ges = t$ges)
  for (k in c("GG eps", "Pr(>F[GG])", "HF eps", "Pr(>F[HF])"))
    out[[k]] <- if (is.null(adj)) NA else adj[, k][match(out$effect, rownames(adj))]
  names(out)[8:11] <- c("eps_GG", "p_GG", "eps_HF", "p_HF")
  out[is.na(out$eps_GG), c("p_GG", "p_HF")] <- NA; eps <- ifelse(is.na(out$eps_GG), 1, out$eps_GG); out[c("np2_low", "np2_high")] <- t(mapply(limits_np2, out$F, eps * out$df1, eps * out$df2))
  out$W <- sph[, 1][match(out$effect, rownames(sph))]; out$p_W <- sph[, 2][match(out$effect, rownames(sph))]
  out
}
# Pairs of one effect; `tukey` for a factor between people, otherwise Holm over the pairs that differ in one factor.
pairs_of <- function(d, form, effect, tukey) {
  for (k in names(d)) if (!k %in% c("participant", "score")) d[[k]] <- factor(d[[k]], unique(d[[k]]))
  a <- suppressWarnings(suppressMessages(aov_car(form, data = d))); by <- strsplit(effect, ":")[[1]]
  grid <- suppressMessages(emmeans(a, by)); cell <- as.data.frame(grid)[by]; k <- combn(nrow(cell), 2)
  one <- colSums(t(cell)[, k[1, ], drop = FALSE] != t(cell)[, k[2, ], drop = FALSE]) == 1
  s <- as.data.frame(summary(contrast(grid, "pairwise"), infer = TRUE, adjust = "none"))[one, ]; k <- k[, one, drop = FALSE]
  name <- apply(as.matrix(cell), 1, paste, collapse = ", ")
  p <- if (tukey) as.data.frame(contrast(grid, "pairwise", adjust = "tukey"))$p.value else p.adjust(s$p.value, "holm")
  # Standard deviation of the scores within groups, from a linear model of each person's mean or difference.
  between <- setdiff(names(a$data$wide), c("participant", dimnames(a$lm$coefficients)[[2]]))
  sd <- apply(k, 2, function(i) {
    mean_of <- function(j) { e <- d; for (f in setdiff(by, between)) e <- e[e[[f]] == cell[[f]][j], ]; aggregate(score ~ participant, e, mean)$score }
    e <- d[match(sort(unique(d$participant)), d$participant), ]
    e$y <- if (any(cell[i[1], intersect(by, between)] != cell[i[2], intersect(by, between)])) mean_of(i[1]) else mean_of(i[1]) - mean_of(i[2])
    sigma(lm(reformulate(c("1", if (length(between)) paste(between, collapse = "*")), "y"), e))
  })
  lim <- t(mapply(limits_t, s$t.ratio, s$df)) * s$SE / sd
  data.frame(effect, first = name[k[1, ]], second = name[k[2, ]], difference = s$estimate, low = s$lower.CL, high = s$upper.CL, df = s$df,
             t = s$t.ratio, p = s$p.value, p_pairs = p, d = s$estimate / sd, d_low = lim[, 1], d_high = lim[, 2])
}
go <- function(name, form, between, ...) {
  d <- read.csv(paste0(name, ".csv")); write.csv(table(d, form), paste0(name, "_r.csv"), row.names = FALSE)
  found <- lapply(c(...), function(effect) pairs_of(d, form, effect, effect %in% between))
  write.csv(do.call(rbind, found), paste0(name, "_pairs_r.csv"), row.names = FALSE)
}
go("one_way", score ~ Error(participant/object), "", "object")
go("two_way", score ~ Error(participant/(surface*object)), "", "surface", "object", "surface:object")
go("levels_2_3_5", score ~ Error(participant/(a*b*c)), "", "a", "b", "c", "a:b")
go("rm3", score ~ Error(participant/(surface*presented*rated)), "", "surface", "presented", "rated", "surface:presented:rated")
go("random_walk", score ~ Error(participant/day), "", "day")
go("five_points", score ~ Error(participant/(strength*object)), "", "strength", "object", "strength:object")
go("large_effects", score ~ Error(participant/(surface*object)), "", "surface", "object")
