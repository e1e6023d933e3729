suppressMessages(library(afex)); options(digits = 15)
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
  out$W <- sph[, 1][match(out$effect, rownames(sph))]; out$p_W <- sph[, 2][match(out$effect, rownames(sph))]
  out
}
go <- function(name, form) write.csv(table(read.csv(paste0(name, ".csv")), form), paste0(name, "_r.csv"), row.names = FALSE)
go("one_way", score ~ Error(participant/object))
go("two_way", score ~ Error(participant/(surface*object)))
go("levels_2_3_5", score ~ Error(participant/(a*b*c)))
go("rm3", score ~ Error(participant/(surface*presented*rated)))
# Groups of unequal size: afex takes sum contrasts and sums of squares of type III.
go("between", score ~ hand * site + Error(participant/(surface*object)))
