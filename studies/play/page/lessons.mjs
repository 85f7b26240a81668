// What the page says of each step, and of settings between the steps.

/** Names of the five steps in their order; those of `PRESETS` train with these settings. */
export const STEPS = ["unload", "positions", "paper", "blank", "shuffled"];

export const SENTENCES = {
  unload:
    "A pick pulls one of the 128 boxes nearest to the entrance upwards: " +
    "click one on which no other lies.",
  positions:
    "In 64 containers an agent, which sees the boxes’ positions, " +
    "learns from its own picks which box to take.",
  paper:
    "Now it sees, as in the paper, only ranks: " +
    "each box’s number in the order along x, y and z.",
  blank:
    "Nothing is trained: the same weights choose in fresh containers, with x and y set to 0.",
  shuffled:
    "It learns anew, with shuffled places: in each remembered pick the boxes exchange theirs, " +
    "so that no place can be learned.",
  stuck: "Without the mask, a box that has just failed may be chosen again, and again.",
  own: "Your own settings: Train goes on with them, Reset brings back the first weights.",
};

/** The verdict of a step that needs a trained network where there is none. */
export const UNTRAINED = "There is no trained network yet: take step 3 first.";

/** The first step that has not been done; undefined after all. */
export const nextStep = (done) => STEPS.find((step) => !done.has(step));
