# Made-up answers for reference.R, from random numbers: R 4.2.2.
set.seed(20261123); person <- function(n) sprintf("p%02d", seq_len(n))
save <- function(d, name) write.csv(d, paste0(name, ".csv"), row.names = FALSE, quote = FALSE)
cross <- function(n, ...) { d <- expand.grid(c(rev(list(...)), list(participant = person(n))), stringsAsFactors = FALSE); d[rev(names(d))] }
level <- function(d, sd) rnorm(nrow(d), sd = sd)[match(d$participant, d$participant)]
# Three groups of 4, 6 and 9 people.
d <- cross(19, surface = c("plain", "grooved")); d$site <- rep(c("a", "b", "c"), 2 * c(4, 6, 9))
d$score <- round(5 + (d$site == "c") * 2 + (d$surface == "plain") * .4 + level(d, 1) + rnorm(nrow(d), sd = .8), 2); save(d, "three_groups")
# Four groups of unequal size from two factors, with a real interaction.
d <- cross(22, object = c("brush", "sponge", "towel")); g <- rep(1:6, c(3, 3, 4, 5, 3, 4))
d$hand <- rep(c("left", "right")[1 + g %% 2], each = 3); d$site <- rep(c("a", "b", "c")[(g + 1) %/% 2], each = 3)
d$score <- round(3 + (d$hand == "left" & d$object == "towel") * 2 + level(d, 1) + rnorm(nrow(d)), 2); save(d, "six_groups")
# Strongly violated sphericity: a random walk over six days.
d <- cross(14, day = paste0("d", 1:6)); d$score <- round(unlist(lapply(1:14, function(i) cumsum(rnorm(6, .3)))), 2); save(d, "random_walk")
# Ratings of 1 to 5 with many ties, forty people.
d <- cross(40, strength = c("weak", "strong"), object = c("brush", "sponge", "towel"))
d$score <- pmin(5, pmax(1, round(2.5 + (d$strength == "strong") * .8 + level(d, .8) + rnorm(nrow(d))))); save(d, "five_points")
# Very large effects, four people.
d <- cross(4, surface = c("plain", "grooved"), object = c("brush", "sponge"))
d$score <- round(10 * (d$surface == "plain") + 3 * (d$object == "brush") + level(d, .3) + rnorm(nrow(d), sd = .2), 3); save(d, "large_effects")
