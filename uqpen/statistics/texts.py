"""Texts of estimates in archives: methods of intervals, reasons for none, and warnings.

Names in braces are placeholders of `str.format`.
"""

from __future__ import annotations

# Methods of intervals.
STUDENT_WITH_EXTREMES = "Student t, both ends moved out by the furthest runs"
STUDENT_WEIGHTED_WITH_EXTREMES = (
    "Student t at the effective size, self-normalised weights, both ends moved out by the furthest "
    "runs"
)
STUDENT_OVER_REPLICATES = "Student t over replicates"
STUDENT_FOR_SKEWED_REPLICATES = "Student t over replicates, the end of the longer tail moved out"
STUDENT_ON_RESIDUALS = "Student t on the residuals of an additive fit"
STUDENT_AS_INDEPENDENT = "Student t, as of independent draws"
STUDENT_OVER_TRAJECTORIES = "Student t over trajectories"
CLOPPER_PEARSON = "Clopper-Pearson"
MOVER_OF_QUANTILES = "intervals of both quantiles joined by MOVER, with their correlation"
DISCORDANT_PAIRS = "Clopper-Pearson on the pairs of runs whose event changes, MOVER"
CLOPPER_PEARSON_WEIGHTED = "Clopper-Pearson at the effective number of runs (Korn-Graubard)"
STUDENT_OR_CLOPPER_PEARSON = (
    "Student t over replicates; Clopper-Pearson with fewer than 10 runs on a side"
)
FOR_ANY_OUTCOME = "{method}, for any outcome of the missing runs"
SIMULTANEOUS_BAND = "Dvoretzky-Kiefer-Wolfowitz-Massart"
ORDER_STATISTICS = "order statistics (binomial)"
WOODRUFF = "Woodruff, over replicates"
WOODRUFF_WEIGHTED = "Woodruff, self-normalised weights"
ONE_SIDED = "one-sided, {method}"
TWO_SIDED = "two-sided, {method}"
TWO_WOODRUFF = "two Woodruff intervals combined, {error_model}"
DELTA_METHOD = "delta method, {error_model}"
DELTA_ON_LOGARITHM = "delta method on the logarithm, {error_model}"
DELTA_FOR_SKEWED = f"{DELTA_ON_LOGARITHM}, the end of the longer tail moved out"
DELTA_ON_FISHER = "delta method on Fisher's transform, {error_model}"
JACKKNIFE = "jackknife over replicates"
WIDER_OF_TWO = "the wider of jackknife over replicates and delta method over blocks"
DELONG = "DeLong on the logit"
SURROGATE_SAMPLING = "sampling of the surrogate"
CORRECTED_STUDENT = "surrogate corrected by runs: Student t, moved out for rare values"
CORRECTED_DELTA_ON_LOGARITHM = (
    "surrogate corrected by runs: delta method on the logarithm, moved out for rare values"
)
CORRECTED_BONETT_PRICE = "surrogate corrected by runs: Bonett-Price"
CORRECTED_WOODRUFF = "surrogate corrected by runs: Woodruff, by Bonett-Price intervals"
CORRECTED_TWO_WOODRUFF = f"{CORRECTED_WOODRUFF}, of both ends as independent ones"
CORRECTED_BRACKET = "surrogate corrected by runs: between a lower and an upper bound, delta method"


# Control variates: a model with its cheap stand-ins.
CONTROL_VARIATES = (
    "best linear combination with {models}: Student t, both ends moved out by the furthest runs "
    "and by what lies beyond all common runs"
)
CONTROL_VARIATES_OF_LOGARITHM = f"{CONTROL_VARIATES}; on the logarithm"
MATCHED_THRESHOLD = "threshold of the closest stand-in matched in the common runs; Bonett-Price"
AS_NARROW_AS = "as narrow as from about {runs} runs of the model alone"
ADMITS_OTHER_POINTS = "stand-ins are not used: they admit other points"
FEW_COMMON_RUNS = "stand-ins are not used: only {runs} runs are common"
HEAVY_AMONG = "heavy tail of the model or of its closest stand-in (kurtosis {kurtosis:.3g})"

# Bands over all places of a field, and ranked curves.
SIMULTANEOUS = "{method}, at a level that holds at all places at once"
MULTIPLES_OF_DISTANCES = "order statistics of multiples of the distances to quantiles of a third"
NO_BAND_OF_ONE_SET = "no simultaneous band is known for one stratified set"
FEW_REPLICATES = "fewer than {replicates} replicates are too few for a simultaneous band"
FEW_DECIDE_THE_MEAN = "fewer than {runs} effective runs decide the mean at this place"
CURVES_MAY_JUMP = (
    "curves may jump at this place: fewer than {runs} effective runs decide the change to the next"
)
WIDEST_DISTANCES = "few runs decide the spread at this place; the band is as high as anywhere"
FEW_REACH = "fewer than {runs} runs reach this place, or not all replicates do"
LEFT_OUT = "{places} of {of} places: {reason}{extent}"
TOLERANCE_BAND_NEEDS = "a tolerance band needs at least {runs} runs"
REGION_OF_RUNS = "a region of these runs, not an interval"

# Rare events, by designs that move towards them.
STUDENT_ON_LOGARITHM = "Student t on the logarithm, over whole replicates"
CORRECTED_COUNTS = (
    "surrogate corrected by weighted runs: gamma intervals of its errors of both kinds, MOVER"
)
SURROGATE_ALONE = "the surrogate alone says {probability:.3g}, which has no interval"
PART_NOT_MET = (
    "parts of the event that no run has met are not in it: as near to the medians as the nearest "
    "run that shows it, the runs would have met one of {probability:.2g} or more, with 95 %"
)
EVENT_NEVER_SEEN = "no run shows the event: its probability is too small for these runs"
NOT_MET_BY_ALL = "not all replicates have met the event"
SEEN_IN_SOME = f"{NOT_MET_BY_ALL}: their scatter gives no interval, and the value may be far off"
REPLICATES_SAY_NOTHING = (
    "the estimates of the replicates differ by a factor above {factor}: they say nothing of the "
    "probability"
)
NO_ADMISSIBLE_REPLICATE = "a replicate has no admissible draw"
UNMET_PART = (
    "parts of the event that no replicate met are not in it; as many plain runs would show a part "
    "of {probability:.2g} or more, with 95 %"
)
UNLED_OUTCOME = (
    "only a few independent draws ended as {outcome}, and no level leads there: intervals of such "
    "an event covered in 88 to 93 %; importance sampling looks further"
)
FEW_DRAWS_DECIDE = "weights: {size:.2g} effective draws decide a replicate"
FEW_RUNS_IN_REPLICATES = (
    "replicates of fewer than {runs} runs: intervals of {few} runs each covered in 88 to 94 %"
)
REPLICATES_DIFFER = (
    "the replicates differ by more than their draws explain: some have met a part of the event "
    "that others have not, and the interval may be too narrow"
)
FORM_HAS_NO_INTERVAL = (
    "FORM takes the limit as a plane, and nothing in it measures the error of that: it has no "
    "interval, and a design that samples this event, such as importance-sampling, corrects it"
)
NO_DESIGN_POINT = "no search has reached a design point: a design that samples this event may"
FORM_PAST_FAILED = "{runs} runs failed, and what lies there is not in it"
DESIGN_POINT = (
    "design point at the reliability index {index:.4g}: {values}, importance factors in brackets; "
    "first order {first:.3g}, "
)
SECOND_ORDER = "second order {probability:.3g}"
NO_SECOND_ORDER = "no second order: the curvature is not known or too large"
UNMET_BY_DRAWS = (
    "parts of the event that no draw met are not in it; one that is no nearer to the median than "
    "what they met ({distance:.2g} standard deviations) has a probability below {probability:.2g}, "
    "with 95 %"
)
UNMET_UNBOUNDED = (
    "parts of the event that no draw met are not in it, and these draws give no bound on one as "
    "far from the median as what they met ({distance:.2g} standard deviations)"
)

# Tails of an output.
SHORTFALL = "Student t over the runs beyond the quantile, moved out by the furthest runs"
SHORTFALL_OVER_REPLICATES = (
    "Student t over replicates, the end of the longer tail moved out, and by the furthest runs"
)
SHORTFALL_MAY_NOT_EXIST = "heavy tail ({runs:.1f} effective runs): the mean may not exist"
FEW_BEYOND_QUANTILE = "fewer than ten runs lie on one side of the quantile"

PROFILE_LIKELIHOOD_OF_TAILS = (
    "profile likelihood of generalised Pareto tails, over all thresholds that fit, as of "
    "independent draws"
)
PART_OF_FIT = "a part of the fit of the tail, whose error is in the interval of the return level"
FEW_RUNS_FOR_A_TAIL = "fewer than {runs} runs are too few to fit a tail"
NO_TAIL_FITS = (
    "no tail of {runs} or more runs is that of a generalised Pareto distribution (p-value below "
    "0.1)"
)
TAIL_ENDS = (
    "the tail ends so abruptly (shape {shape:.2g}, below -0.5) that its likelihood gives no "
    "interval: see the quantiles"
)
BELOW_THE_TAIL = "it lies below the threshold of the fitted tail: see the quantiles"
TAIL_OF_RUNS = "tail of {runs} runs (p-value of the fit {p_value:.2g})"
BEYOND_ALL_RUNS = "beyond all runs: it holds if the tail goes on as fitted"
MISSING_FROM_TAIL = "{runs} failed runs may lie in the tail, and are left out"
TAIL_WITHOUT_BOUND = "the runs exclude no large value"

# Sensitivities of a probability, and conditional probabilities.
SCORES = "Student t on the scores of the event, both ends moved out by the furthest runs"
SCORES_OVER_REPLICATES = "Student t over whole replicates, on the scores of the event"
FEW_SCORES_DECIDE = "only {runs:.0f} effective runs decide it"
DIAGNOSTIC_OF_SCORES = "a diagnostic of the scores, not an estimate"
FEW_REPLICATES_OF_SCORES = "fewer than {replicates} replicates are too few for an interval"
MOVED_ALONE = "the random inputs depend on each other, so none can move by itself"
MOVED_TOGETHER = "its distribution has no mean that can move without its standard deviation"
MEAN_IS_0 = "no elasticity to a mean of 0"
CONDITION_NEVER_SEEN = "no completed run meets the condition: {condition}"
RUNS_OF_CONDITION = "of the {runs} runs that meet the condition"

# Quantiles of the output of a rare event.
INVERTED_OVER_REPLICATES = f"{STUDENT_ON_LOGARITHM}, of the probability beyond, inverted"
SEVERAL_LIMITS = "the event has several limits, so its levels are not those of one output"
BEYOND_ALL_LEVELS = "too far out: the runs do not reach it in all replicates"

# Reasons from the sampling, and from the number of completed runs.
NOT_A_SAMPLE = "the points are not a sample of the input distribution"
NOT_DECLARED_INDEPENDENT = "the points are not declared independent (independent = true)"
NO_RUN = "no run completed"
NO_RUN_OF_A_AND_B = "no run of the matrices A and B completed"
SINGLE_RUN = "a single run has no scatter"
SMALL_EFFECTIVE_SIZE = "weights: an effective sample size of {size:.3g} is too small"
SMALL_SHARE = "weights: the effective size is {share:.2g} % of the runs, and an interval needs 30 %"
FEW_ON_A_SIDE = "weights: fewer than 30 effective runs lie on one side"
APPROXIMATE = "approximate: the weights leave {share:.2g} % of the runs"
SIZES_OF_EVENT = "effective runs with the event {on:.0f}, without it {off:.0f}"
NOT_WEIGHTED = "weights: it is known for equally weighted draws only"
FEW_WEIGHTS_DECIDE = "weights: {runs:.0f} effective runs decide it"
NO_WEIGHTED_BAND = "weights: no simultaneous band is known"
SINGLE_REPLICATE = "all completed runs are of one replicate"
ONE_IS_TOO_FEW = "a single run is too few"
TOO_FEW_RUNS = "{runs} runs are too few"
NO_LOWER_BOUND = "{too_few} for a lower bound"
NO_UPPER_BOUND = "{too_few} for an upper bound"
RUNS_NEEDED = "least number of independent runs with an upper bound"
RUNS_NEEDED_BELOW = "least number of independent runs with a lower bound"
RUNS_NEEDED_FOR_BAND = "least number of independent runs with a band"
RUNS_NEEDED_FOR_BOTH = "least number of independent runs with both bounds"
UPPER_BOUND_NEEDS = "an upper bound needs at least {runs} runs"
LOWER_BOUND_NEEDS = "a lower bound needs at least {runs} runs"
BOTH_ENDS_NEED = "a tolerance interval needs at least {runs} runs"
TOO_ONE_SIDED = "fewer than ten runs lie on one side"
FEW_WEIGHTED_BEYOND = "weights: fewer than ten effective runs lie on one side"
MISSING_RUNS = "allows for any outcome of the missing runs ({runs})"

# Reasons from a lack of variation or scatter.
CONSTANT_OUTPUT = "the output does not vary"
CONSTANT_INPUT = "the input does not vary"
CODES_WITHOUT_ORDER = "its texts are coded, and the codes have no order"
CONSTANT_EVENT = "the event occurs in all runs or in none"
CONSTANT_AT_DRAWS = "it is the same at all draws"
NO_SCATTER_OF_STRATA = "the stratified points show no scatter, so the error is unknown"
NO_SCATTER_OF_RUNS = "the runs show no scatter, so the error is unknown"
LINEARLY_DEPENDENT = "the inputs and the output are linearly dependent"

# Of a design that has stopped by a rule.
NUMBER_DECIDED_BY_RUNS = (
    "the runs decided their own number, and the coverage of this interval is not certified for that"
)

# Tails, and intervals that may be too narrow.
NO_INTERVAL = "no reliable interval is known"
NO_INTERVAL_OF_DELTA = "no reliable interval is known: the bias may exceed the scatter"
NO_INTERVAL_AS = "{reason}: no reliable interval is known"
DOUBTFUL_AS = "{reason}: the coverage may be below nominal"
HEAVY_TAIL = "heavy tail (kurtosis {kurtosis:.3g}, {runs:.0f} effective runs)"
MEAN_MAY_NOT_EXIST = "{heavy_tail}: the mean may not exist"
HIDDEN_TAIL = "fewer than {runs} runs are too few to detect a heavy tail"
HIDDEN_TAIL_OF_WEIGHTED = (
    "weights: an effective sample size below {runs} is too small to detect a heavy tail"
)
# What figures are of where the model has noise of its own: no caution, but their name.
OF_THE_MEAN = "of the mean given the inputs: the noise of the model is left out"
OF_THE_WHOLE = "of the whole output, noise of the model included"
REMAINING = (
    "what is left of the variance if all other inputs are known, noise included: (1 − N) T + N "
    "with the noise's share N of the variance and the total-order index T of the mean"
)
DOUBTFUL_TAIL = (
    "the interval may be too narrow if extreme values are more frequent than in these runs"
)
DIAGNOSTIC = "a diagnostic of the tail, not an estimate"
DIAGNOSTIC_OF_WEIGHTS = "a diagnostic of the weights, not an estimate"
SEE_HALF_SPREAD = "see half the 16–84 % range"
SEE_RANKS = "see the rank correlations"
ONLY_RUNS = "only {runs} runs"
ONLY_BLOCKS = "only {blocks} blocks"
FEW_BLOCKS = "fewer than {blocks} blocks: the coverage may be below nominal"
ONLY_EFFECTS = "only {effects} effects: the coverage may be below nominal"
FEW_DIFFER = (
    "only {distinct} of {effects} effects differ from the others: the coverage may be below nominal"
)

# Texts at the places of a field, without the numbers of the texts above: they differ by the place.
HEAVY_TAIL_AT_PLACES = "heavy tail"
SMALL_EFFECTIVE_SIZE_AT_PLACES = "weights: the effective sample size is too small"
FEW_WEIGHTS_DECIDE_AT_PLACES = "weights: few effective runs decide it"
TOO_FEW_RUNS_AT_PLACES = "the runs are too few"

# Quadrature rules.
NO_SCATTER_OF_RULE = "a quadrature rule has no scatter, so its error is unknown"
IMPOSSIBLE_MOMENT = "negative weights of the rule give an impossible {moment}: try a higher order"
MISSING_NODES = "biased: {failed} of {nodes} nodes failed ({share:.3g} % of the weight)"
ABSENT_NODES = "biased: {failed} of {nodes} nodes gave no value ({share:.3g} % of the weight)"
NO_WEIGHT = "the weights of the completed runs add up to zero"

# Elementary effects and responses.
NO_EFFECT = "no step has two completed runs"
SINGLE_EFFECT = "a single effect has no scatter"
TOO_FEW_EFFECTS = "at least two effects are needed"
NO_SCATTER_OF_EFFECTS = "the effects show no scatter, so their error is unknown"
MISSING_EFFECTS = "{failed} of {effects} effects are missing because a run failed"
ABSENT_EFFECTS = "{failed} of {effects} effects are missing because a run gave no value"
ONE_POINT = "a derivative at one point has no scatter"
FIXED_INPUT = "a fixed input has no uncertainty"
ONE_SIDED_STEP = "from the step {side} only: the other run failed"
ONE_SIDED_STEP_ABSENT = "from the step {side} only: the other run gave no value"
ONE_SIDED_DESIGN = "from the step {side} only, as the design says"
NONLINEAR = "nonlinear: {down:.3g} from the step down, {up:.3g} from the step up"
NONLINEAR_CHANGE = "nonlinear: the steps up and down differ by more than a tenth"
OF_SI_VALUE = "relative to the {of} in {si}, not in {unit}"
OF_HALF_SPREAD = "relative to half the input's 16–84 % range, as its nominal value is 0"
NOMINAL_RUN_FAILED = "the run at the nominal point failed"
NOMINAL_RUN_ABSENT = "the run at the nominal point gave no value"
NOMINAL_OUTPUT_IS_0 = "the output is 0 at the nominal point"
STEP_FAILED = "both runs of the step failed"
STEP_ABSENT = "both runs of the step gave no value"

# Analyses of SALib.
SALIB_FAILED = "SALib's {method} fails for these runs: {error}"
SALIB_DIFFERS = "two calls of SALib's {method} with the same seed gave different results"
SALIB_NO_NUMBER = "SALib's {method} gave no number"
SALIB_NO_INTERVAL = "SALib has no interval of it"
SALIB_BOOTSTRAP = "SALib's bootstrap of half of the runs, wider than stated"
SALIB_HALVES = "the scatter over halves of the runs, as SALib has it, lacks the bias of the fit"
SALIB_DELTA = "it depends on SALib's seed, and is biased: no reliable interval is known"
SALIB_INDEPENDENCE = "{method} needs inputs that are independent of each other"
SALIB_CUT = (
    "some points are inadmissible or without a value, so the others' inputs may be dependent"
)
SALIB_TOO_LARGE = "SALib's {method} would take minutes for so many runs and inputs"
SALIB_ONE_INPUT = "SALib's expansion needs two inputs or more"
PAWN_FLOOR = "not above that of a permuted input: no effect is seen"
HDMR_TERMS = "the expansion has {terms} terms, which need {runs} runs"
HDMR_UNUSABLE = "not usable: the expansion leaves {share:.3g} % of the variance unexplained"
ONE_CURVE = "a curve has no scatter, and resampling its places has no meaning"
LOST_ON_CURVE = "{lost} of the {runs} runs of its curve gave no value, and FAST needs all"
DGSM_INTERVAL = "SALib's bootstrap takes points of a sequence for independent draws"
LOST_PAIRS = "{lost} of {pairs} pairs of runs are left out, as one gave no value"
LOST_OF_LEVELS = "{lost} of {runs} runs gave no value, and each effect needs all"
LEVELS_INTERVAL = "each effect follows from all runs, which have no scatter"
UNUSED_COLUMNS = "of a column without an input, the largest effect is {largest:.3g} (in SI units)"

# Sobol' indices and Shapley effects.
INCLUDES_CORRELATION = "includes correlation"
OPTIMIZED_POINTS = "optimized points are not independent: replicates are needed"
ENDED_BLOCKS = "blocks with a curve that ends before are left out"
FEW_BLOCKS_REACH = "fewer than half of the blocks reach the place as a whole"
NO_BLOCK = "no block is complete"
BLOCKS_OF_ONE_REPLICATE = "all complete blocks are of one replicate"
FEW_INFORMATIVE_BLOCKS = "fewer than ten blocks contribute to it"
VARIES_IN_ONE_REPLICATE = "it varies in one replicate only"
TOO_MANY_SUBSETS = "it needs all subsets of the inputs, too many for {inputs} inputs"
DEPENDENT_INPUTS = "the random inputs depend on each other"
ESTIMAND = "indices of the input distribution"
ESTIMAND_IF = "indices of the input distribution, conditional on {condition}"
ESTIMAND_IF_ADMISSIBLE = ESTIMAND_IF.format(condition="admissible inputs")
FAILED_BLOCKS = "blocks with a failed run are left out"
ABSENT_BLOCKS = "blocks with a run without a value are left out"
INADMISSIBLE_BLOCKS = "blocks without an admissible draw are left out"
OF_PART = "from {part} of {of} runs: {reason}"
WEIGHTS_IN_MEMORY = "weighted runs are analysed in memory"
RANKS_IN_MEMORY = "failed runs are ranked among the others in memory"
INPUTS_IN_MEMORY = "the scores of inputs are computed in memory"
SENSITIVITIES_IN_MEMORY = "sensitivities are analysed in memory"
TAILS_IN_MEMORY = "the tail is analysed in memory"
FIELD_IN_MEMORY = "a field is analysed in memory"
USER_DEFINED_IN_MEMORY = "a user's analysis takes all values at once"
FIRST_ORDER_INCLUDES = "first-order indices include correlation"

# Estimators of a surrogate.
FROM_DRAWS = "by sampling the surrogate at {draws} admissible draws"
NO_PAIRS = "none: inputs cannot be drawn given others"
CORRECTED_BY = "{estimator}; corrected by {runs} runs"
PLACED_AMONG = ", {placed} of them placed where the surrogate expected to err"
FROM_PAIRS = "by sampling the surrogate at {pairs} pairs of draws for each set of inputs"

# A surrogate that runs refute has no estimates.
CHECK_RUNS = "{runs} check runs"
RUNS_LEFT_OUT = "{runs} training runs left out"
DRAWS = "draws of the inputs"
REFUTED = "the surrogate is refuted: it predicts {runs} worse than their mean does (Q² {q2})"
REFUTED_AS_NOT_FINITE = "the surrogate is refuted: not all of its predictions of {runs} are finite"
REFUTED_BY_ITS_MEAN = (
    "the surrogate is refuted: the mean of its predictions is beyond all {runs} runs"
)

# Nor has one whose runs are of other inputs than those that it is asked about.
CONTRADICTED = (
    "the runs contradict the stated independence of the inputs: {contradiction}; [dependence] of "
    "the study can state it"
)

# Estimates of a surrogate that runs cannot correct.
NO_CORRECTION = "no correction by runs is known for it: this is the surrogate's own figure"
NO_TAIL_OF_SURROGATE = (
    "no tail is fitted to draws of a surrogate: beyond its runs they say nothing of the model"
)
NOT_POSITIVE_IN_RUNS = "some of the runs that correct it are not positive"
NO_BAND_KNOWN = "no simultaneous band is known"
NO_VARIANCE_LEFT = "the runs leave no variance"
HEAVY_TAIL_OF_SURROGATE = "heavy tail (kurtosis {kurtosis:.3g} of the runs or the surrogate)"
EXPLAINS_TOO_LITTLE = "the surrogate explains {share:.0f} % of the variance at runs left out"
TOO_LITTLE_ALONE = "{explained}, too little for a figure that no run corrects"
OF_RUNS_ALONE = "the interval is that of the runs alone, as the surrogate does not make it narrower"
NARROWER_ELSEWHERE = "the runs alone have a narrower interval, which does not hold this estimate"
NARROWER_IF_SMOOTH = "the runs alone have a narrower interval, which supposes a smooth output"
SEE_QUANTILES = "see the quantiles"
WITHOUT_VALUE_IN_RUNS = "some of the runs that correct it have no value of it"
NOT_FINITE_PREDICTIONS = "predictions of it are not finite"
NOT_FITTED_WITHOUT = "not fitted without a fold of its training runs: {reason}"
NO_CORRECTING_RUN = "no run corrects it"
FEW_CORRECTING_RUNS = "{runs} runs are too few to correct it"
NO_ADMISSIBLE_DRAW = "too few draws of the surrogate are admissible"
NO_INDICES_OF_PLACED = (
    "no interval of indices is known with {placed} placed runs, which have weights"
)
# Until `benchmarks/corrected_coverage.py refined` has been run over 1 000 seeds.
OF_PLACED_RUNS = "not certified: the coverage with {placed} placed runs is known from few seeds"
OF_ALL_ADMISSIBLE = (
    "of all admissible inputs: {missing} runs failed, and the interval allows for what they may "
    "have given"
)

# Models with noise of their own.
FIELLER = "Fieller's set, {error_model}"
FIELLER_OVER_REPLICATES = "Fieller's set over replicates"
ROOT_OF_INTERVAL = "root of the variance's: delta method, {error_model}"
NOISE_HIDES_IT = (
    "noise hides it: the variance of the mean given the inputs may be 0; more points would show it"
)
NO_NOISE_SEEN = "the repeats of every point agree"
FEW_POINTS = "fewer than {points} points: the coverage may be below nominal"
TOO_FEW_POINTS = "{points} points are too few"
NO_REPEATED_POINT = "no point has two completed runs"
CLUSTERS = "{method}; a point with its repeats counts as one"

# Failed runs.
ADMISSIBLE_INPUTS = "admissible inputs"
# Of an output that some runs do not have.
ALL_EXIST = "of the runs in which all its outputs have a value"
VALUE_EXISTS = "its existence ({absent} in {share:.3g} % of the completed runs)"
REACHED = "the curve's reaching the place"
NOT_ALL_REACH = "some curves end before, and the inputs of the others depend on each other"
MISSING_SHARE = "{share:.3g} % of the admissible runs"
FEW_FAILED = "fewer than {runs} failed runs are too few for an interval"
FEW_COMPLETED = "fewer than {runs} completed runs are too few for an interval"
LARGER_IF_FAILED = "probability that an input {is_larger} in a failed run than in a completed one"
END_OF_FAILED = "{end} value of each input among the failed runs, in SI units"
SEPARATED = "the failed runs are completely separated from the others"

# Answers over unknowns of distributions.
FIRST_RUNS = "from the first {runs} runs"
OVER_DRAWS = (
    "quantiles over {draws} draws of the fitted parameters, each with a draw for the sampling error"
)
CURVES_OF_DRAWS = (
    "quantiles over the functions of {draws} draws of the fitted parameters, without the sampling "
    "error"
)
FEW_RUNS_OF_DRAWS = "fewer than 5 % of the runs count for {few} of {draws} draws"
NO_RUN_OF_DRAW = "no run counts for a draw of the parameters"
WITHOUT_MISSING = "without the missing runs ({runs})"
FAMILY_IS_GIVEN = "the family is taken as known"
OVER_BOX = "{method}; the outer limit is that of all {points} distributions"
END_OF_BOX = {"lower": "least, with {at}", "upper": "largest, with {at}"}
FEW_RUNS_OF_BOX = (
    "no bounds: {least:.3g} effective runs ({share:.2g} %) count for a distribution of the box "
    "(at least {fewest}, and {most:g} %): take more runs, or narrower intervals"
)

# Bounds over intervals.
FOUND_BOUND = "{which} found by a search, at {at}"
PEAK_BETWEEN_RUNS = "peaks narrower than {gap:.2g} % of an interval can lie between its runs"
UNPREDICTED_BOUND = (
    "no bounds: the polynomial of the search leaves {share:.3g} % of the output's variance at its "
    "optimum (at most {most:g} %), so others may be missed; the widest gap between its runs is "
    "{gap:.2g} % of an interval"
)
NO_POLYNOMIAL_OF_BOX = "no bounds: no polynomial could be fitted to the runs of the search"

# Publications.
PUBLISHED = "published in {source}"
PUBLISHED_NOISE = "scatter of {runs} independent runs as seen here, and the rounding of the print"
PUBLISHED_ROUNDING = "rounding of the print"

# Unknowns from measurements.
LINEAR_NORMAL = "normal, by the linear model at the minimum and the stated errors"
LINEAR_STUDENT = "Student t, by the linear model at the minimum and the scatter of the residuals"
LINEAR_REPEATS = (
    "Student t with {freedom} degrees of freedom, by the linear model at the minimum and the "
    "scatter of repeats"
)
PROFILE_LIKELIHOOD = "profile likelihood"
NOT_TAUGHT = "the measurements do not determine it: see the combinations"
NOT_CONVERGED = "not converged: the next step is {step:.1g} standard errors"
AT_END_OF_PRIOR = "at the end of what its prior and the model admit: the data would go further"
OTHER_MINIMA = "another minimum is nearly as low: see the minima"
BENT = "the model is not linear over this interval: that of the profile holds as often as it says"
NO_PROFILE_ASKED = "no profile was asked for"
NO_PROFILE_END = (
    "no end of the profile was found: it is flat, leaves the support, or runs fail on the way"
)
NO_PROFILE_BUDGET = "profiles need more runs than at_most = {runs}"

# Posteriors of unknown inputs.
EVIDENCE_OF_PRIORS = "it depends on the widths of the priors: twice as wide, half the evidence"
FEW_PRIOR_RUNS = (
    "no posterior: {share:.0%} of the runs of the prior completed, too few for a replicate to move "
    "them, or at_most leaves no run for it"
)
UNFINISHED_POSTERIOR = (
    "no posterior: with {runs} points, the likelihood counts by the power {exponent:.2g} so far; "
    "raise at_most"
)
FAILED_AT_POSTERIOR = "{share:.0%} of the draws around the posterior failed, and are left out of it"
POSTERIOR_PREDICTIVE = "quantiles of the posterior predictive distribution"
BEYOND_MEASURED = (
    "outside of the measured range of {name} nothing is known of the model's own error"
)
STUDENT_OVER_WEIGHTED_DRAWS = "Student's t over weighted draws"
NO_SURROGATE = (
    "no posterior: after {draws} draws no surrogate could be fitted and sampled; {share:.0%} of "
    "those of the prior completed"
)
NOT_CONFIRMED = (
    "not confirmed by the model: {size:.2g} of {draws} weighted draws are effective, so it is the "
    "posterior by the surrogate"
)
RANKS_OF_WEIGHTED_DRAWS = (
    "at weighted ranks times n / (n + 1), which allows for only n = {size:.3g} effective draws"
)
LARGE_R_HAT = "the replicates differ: R-hat is {rhat:.3f}, not below 1.01"
NO_R_HAT = "R-hat is not defined, as the draws hardly vary"
FEW_EFFECTIVE_DRAWS = "the mean is known to {error:.0%} of the standard deviation, not to 5 %"
ENDED_TOO_EARLY = (
    "the last level ended at at_most: draws correlate by {related:.2f} with where it began"
)

# A model compared with measurements.
VALIDATION_INTERVAL = "Student t, k times the standard uncertainty of the comparison error"
RANK_AMONG_DRAWS = "Clopper-Pearson, of the rank among the draws"
BEYOND_NULL = "as far as a model without error reaches at the level"
STUDENT_OVER_DRAWS = "Student t over draws, of other draws but not of other measurements"
AS_INDEPENDENT_ROWS = (
    "as if the values had no error in common, binomial p = {p:.2g}: judge by share_p_value"
)
ROWS_USED_BEFORE = "without {rows} values that inputs were fitted to"
NO_NEW_ROWS = "each value is a bound, or inputs were fitted to it"
FEW_DRAWS = "{draws} draws are too few: {needed} at least"
SINGULAR_COVARIANCE = (
    "some combination of the values has no scatter, neither among draws nor by errors of "
    "measurement"
)
NOT_TESTED = "not in the joint test: a bound, or used before"
MEASURED_BOUND = "no value was measured, but a bound"
NO_NUMERICAL_STD = "without a numerical error, as none is stated"
FAILED_DRAWS = "without {failed} of {draws} draws, in which a run failed"
