"""Labels of data: names of dimensions, groups and attributes.

Every name in an archive stands here once, so that writers and readers agree. Archives that exist
have these texts, so none of them is changed.
"""

from __future__ import annotations

import re

# Name of a design, an input or an output: it becomes a NetCDF group or variable, a key of JSON,
# the name of a folder and, for an input, a keyword argument.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}\Z")

RUN = "run"
BOUND = "bound"
BOUNDS = ("estimate", "lower", "upper")
REPLICATE = "replicate"
# Coordinates of a design that runs each point several times: the number of the point, and that of
# the run at it. They are no reserved names: a study refuses them where it repeats runs.
POINT = "point"
REPEAT = "repeat"
# Of the statistics of such a design: how many runs each point has. The statistics are of the first.
REPEATS = "repeats"
# Of a model with noise of its own whose runs get seeds: the role of the variable with them, and its
# name where it is no input of the model.
SEED = "seed"
RANDOM_SEED = "random_seed"
# What was seen of the noise of a model: an attribute of its group, and of the runs in which it was
# found. The group of the runs that were made twice, where the second ones are others. The analyses
# of several runs at each point.
NOISE = "noise"
ROUND = "round"
BLOCK_NUMBER = "block"
MATRIX = "matrix"
POSITION = "position"
# Attribute of it: the number of harmonics that an index of a search curve sums.
HARMONICS = "harmonics"
MOVED_INPUT = "moved_input"
MOVED_BY = "moved_by"
MOVED_UNCERTAINTY = "moved_uncertainty"
QUADRATURE_WEIGHT = "quadrature_weight"
# Coordinate of a design whose draws are of another distribution than the study's inputs. It is no
# reserved name, as an input may well be a weight: a coordinate is neither input nor output.
WEIGHT = "weight"
# Of a design for a rare event: the event, the name of its method, and what the analysis needs of
# each run. Of subset simulation the level, the run that a candidate was moved from (-1 for none),
# and the performance that it had to reach.
RARE_EVENT = "rare_event"
RARE_EVENT_METHOD = "rare_event_method"
SUBSET_LEVEL = "subset_level"
CHAIN_PARENT = "chain_parent"
LEVEL_THRESHOLD = "level_threshold"
# Of active learning the weight of a run that corrects the surrogate (0 of one to learn from) and
# that by the draws alone which look for unknown parts, whether the surrogate predicts the event
# there (-1 unknown) and the probability that it errs; and what it says alone of the event, with the
# standard error of sampling it, alike for all these runs.
CORRECTION_WEIGHT = "correction_weight"
SEARCH_WEIGHT = "search_weight"
PREDICTED_EVENT = "predicted_event"
PREDICTION_ERROR = "prediction_error_probability"
SURROGATE_PROBABILITY = "surrogate_probability"
SURROGATE_PROBABILITY_ERROR = "surrogate_probability_error"
# Of importance sampling the stage (0 for the search of design points), the component of the mixture
# that a run was drawn from (-1 for none), and the ratio of the inputs' density to the mixture's.
SAMPLING_STAGE = "sampling_stage"
MIXTURE_COMPONENT = "mixture_component"
DENSITY_RATIO = "density_ratio"
# Of FORM the start whose search a run belongs to, the run that it is a step from (-1 for a start),
# and the axis of a finite difference (-1 for a point of the search, -2 for one of the curvature).
SEARCH_START = "search_start"
SEARCH_ORIGIN = "search_origin"
MOVED_AXIS = "moved_axis"
# Of designs at measured experiments, coordinates: the number of the draw or of the searched point,
# and that of the experiment; and an attribute: the sections of their measurements.
DRAW = "draw"
EXPERIMENT = "experiment"
MEASURED = "measured"
# Of least squares an attribute, the number of starts, and a coordinate: the point by whose results
# the residuals are weighted (-1 for the measured values). The start of a run may also be the end of
# a profile, behind the starts.
SEARCH_STARTS = "search_starts"
# Of a posterior: the power of the likelihood in the distribution in which a draw moves (0 for one
# of the prior), the draw that it was moved from (-1 for none), the logarithm of the likelihood that
# it had to reach; and a standard deviation of measurements that is not known, by its number.
LIKELIHOOD_EXPONENT = "likelihood_exponent"
PARENT_DRAW = "parent_draw"
LEAST_LOG_LIKELIHOOD = "least_log_likelihood"
ERROR_STD = "error_std_{number}"
# In its place, where a size is integrated over: the share of its conditional distribution that is
# below the size of a draw.
ERROR_SHARE = "error_share_{number}"
# Of a posterior by a surrogate: the round of a draw (0 of the prior, -1 of the result), the
# logarithm of its likelihood by the surrogate that it was drawn by, and the factor that z scores
# gave the variance of that.
SEARCH_ROUND = "search_round"
PREDICTED_LOG_LIKELIHOOD = "predicted_log_likelihood"
VARIANCE_SCALE = "variance_scale"
# The group of its weighted draws, and their weights.
WEIGHTED_POSTERIOR = "weighted_posterior"
IMPORTANCE_WEIGHT = "importance_weight"
WEIGHTED_AT = "weighted_at"
# Of a posterior: an attribute with what a model has errors of its own along.
DISCREPANCY = "discrepancy"
# Distance of a run from the median of all inputs, in standard normal space.
NORMAL_DISTANCE = "normal_distance"
# Of an input known by an interval: its ends, in the SI unit.
INTERVAL_ENDS = "interval_ends"
# Attribute of an input: the parameters of its distribution that are intervals.
PARAMETER_INTERVALS = "interval_parameters"
# Attribute of an input whose fitted parameters are uncertain: how they were drawn.
UNCERTAIN_FIT = "fit_uncertain"
# Of a design for bounds over intervals: the events, the outputs whose means are bounded, and those
# with a probability whose quantiles are. Of each run the number of the search that has led to it (0
# before the first), the number of the event, mean or quantile in this order (-1 before the first
# search), which of its bounds (-1 the lower, 1 the upper), and what the
# polynomial of the search predicts: how far the run is beyond the limit, or the output itself, in
# standard deviations of the output before the first search.
BOUNDED_EVENTS = "bounded_events"
BOUNDED_MEANS = "bounded_means"
BOUNDED_QUANTILES = "bounded_quantiles"
BOUND_SEARCH = "bound_search"
BOUNDED_QUANTITY = "bounded_quantity"
BOUND_END = "bound_end"
PREDICTED_DISTANCE = "predicted_distance"
# Of the runs of a design: the surrogate that has placed those after the first round.
REFINED_FOR = "refined_for"
INPUT = "input"
SOURCE = "source"
PAIR = "pair"
STATUS = "status"
FAILED_RUN = "lost_run"
FAILURE_REASON = "lost_reason"
# Of a design whose runs are not in the archive: their number, that of their replicates, how many
# have each status (in the order of its flags), a hash of each batch of 1 024, and the causes of the
# failed ones.
RUNS_MADE = "runs_made"
REPLICATES_MADE = "replicates_made"
STATUS_COUNTS = "status_counts"
BATCH = "batch"
BATCH_HASH = "batch_sha256"
CAUSE = "cause"
CAUSE_TEXT = "cause_text"
CAUSE_EXAMPLE = "cause_example"
CAUSE_STATUS = "cause_status"
CAUSE_RUNS = "cause_runs"
RANK = "rank"
# Dimension of the components of a field, in the group of the surrogate that is fitted to it.
PRINCIPAL_COMPONENT = "principal_component"

# Interval metadata of an estimate: attributes of a single one, coordinates along several.
INTERVAL = "interval"
INTERVAL_LABEL = "interval_label"
INTERVAL_LEVEL = "interval_level"
NOTE = "note"
# Beside the corrected estimate of a surrogate: its figure before the correction. Beside that, and
# beside one that cheap models have made narrower: plain runs with an interval as narrow.
SURROGATE_ESTIMATE = "surrogate_estimate"
EQUIVALENT_RUNS = "equivalent_runs"
# Of a band over the places of a field: the places that it leaves out, and why.
LEFT_OUT_PLACES = "left_out"
# Of all intervals, at the root of an archive whose study states another than the default.
CONFIDENCE_LEVEL = "confidence_level"

# Version of the recipe of intervals, at the root of an archive.
RECIPE = "interval_recipe"

# Version of how a surrogate is fitted and its estimates are corrected, an attribute of the source.
SURROGATE_RECIPE = "surrogate_recipe"

RUNS = "runs"
STATISTICS_GROUP = "statistics"
FAILURES_GROUP = "failures"
CALIBRATIONS = "calibrations"
VALIDATION = "validation"
JOINT_GROUP = "joint_probabilities"
BOUNDS_GROUP = "bounds"
# Kind of a source (a design, a surrogate or a publication), and the citation of a publication.
SOURCE_KIND = "kind"
CITED = "cited"
# Attribute of a publication whose responses are printed without their signs.
MAGNITUDES = "magnitudes"
# Analyses that a study leaves out, an attribute of the root.
LEFT_OUT = "left_out"
# Inputs of which each model of a study has another value, an attribute of the root.
SWEEP = "sweep"
# The model that another one is with a finer tolerance or grid, or that it stands for: attributes of
# the group of that other, and keys of its table in a study.
FINER_THAN, STANDS_FOR = "finer_than", "stands_for"
MOMENTS = "moments"
QUANTILES = "quantiles"
EXCEEDANCE = "exceedance"
TAILS = "tails"
SHARES = "shares"
SENSITIVITY = "sensitivity"
CONVERGENCE = "convergence"
SURROGATES = "surrogates"

# Beginnings of the names of statistics that follow from others: of the logarithm of an output, of
# whether it exceeds a value or is in a category, of a whole field, of its mean given the inputs,
# by the runs so far, and if there were more specimens.
OF_LOGARITHM = "log_"
OF_EXCEEDANCE = "exceedance_"
OF_CATEGORY = "category_"
OF_FIELD = "generalized_"
OF_MEAN = "mean_"
BY_RUNS = "convergence_"
MORE_SPECIMENS = "more_specimens_"

TRAJECTORY = "trajectory"
# The files that a study names.
FILES = "files"

# Attributes that an analysis or a reader needs.
ROLE = "role"
SAMPLING = "sampling"
CONDITIONAL = "conditional_on"
MISSING = "missing"
RUNS_SPENT = "runs_spent"
# Of a multifidelity design: the cost of the runs of all models, in runs of the first.
COST_SPENT = "cost_spent"
ESTIMATOR = "estimator"
LARGEST_CONTRIBUTION = "largest_contribution"
# Comment on a curve that may end before its dimension does.
CURVE_MAY_END = "NaN after the end of the curve"
# Of an output that follows from another: the name of that.
DERIVED_FROM = "derived_from"
# Of one that some runs do not have, NaN there: what is true of those runs. Of its statistics: the
# number of completed runs that do not have it.
ABSENT = "absent"
# The output that has the category of each run, where a study declares outcomes.
OUTCOME_OUTPUT = "outcome"
RUNS_ABSENT = "runs_absent"
# Of an output that a surrogate could not be fitted to: the reason.
NOT_FITTED = "not_fitted"
# Of an output whose predictions by a surrogate runs refute: the reason.
REFUTED = "refuted"
DEPENDENCE = "dependence"
# The rule by which a design decided how many runs it makes, and what that means for intervals.
STOPPING_RULE = "stopping_rule"
STOPPING_NOTE = "stopping_note"
STOPPING_AT_MOST = "stopping_at_most"
# The statistics by which it decided, as JSON: a list of output, statistic and label. Intervals of
# others are marked.
STOPPING_STATISTICS = "stopping_statistics"
# The claim that a design decided; of its source: the verdict, the number of runs after which it was
# reached, and an interval of the probability that holds whenever the runs stop.
STOPPING_CLAIM = "stopping_claim"
DECISION = "decision"
DECISION_CLAIM = "decision_claim"
DECISION_RUNS = "decision_runs"
DECISION_PROBABILITY = "decision_probability"
DECISION_LOWER = "decision_lower"
DECISION_UPPER = "decision_upper"
# How well given points follow the distributions that the study states.
AGREEMENT = "agreement_with_inputs"
# How many rows of a data file are left out, and why; values far from all others in their column.
DROPPED_ROWS = "dropped_rows"
DISTANT_VALUES = "distant_values"
# Role of an input that follows from others by a formula, and so has no distribution of its own.
DERIVED_INPUT = "derived input"
# The codes of inputs that are texts in a data file.
CODED_INPUTS = "coded_inputs"
# The texts of such an input, in the order of its codes.
CODE_LABELS = "code_labels"
# How they contradict the independence that the study states, and distributions.
CONTRADICTION = "contradicted_inputs"
CONTRADICTED_DISTRIBUTIONS = "contradicted_distributions"
# The criterion by which points were moved apart.
OPTIMIZED_BY = "points_optimized_by"
# Moved inputs whose nominal value is 0, so that no step is relative to it.
RELATIVE_TO_SPREAD = "relative_to_half_spread"

# Kind of archive, at its root; archives of studies have none.
KIND = "uqpen_kind"
BENCHMARK = "head-to-head"

# The hashes of its groups, at its root.
CONTENT = "content_sha256"

# What runs of earlier archives were made with, at the root of an archive that has taken them. It is
# absent where all of them would be the same here to the bit.
REUSED_RUNS = "reused_runs"
# A line of it ends so, where none of the runs was compared with a fresh one.
NOT_MADE_AGAIN = "runs of which none was made again before they were taken"
# Of runs that were drawn for other distributions of the inputs, and have weights: how many of them
# the weights leave, in words. At the root, the content hash and the study of the archive of the
# runs.
REWEIGHTED = "reweighted"
REWEIGHTED_FROM = "reweighted_from"
REWEIGHTED_STUDY = "reweighted_study_text"
# The content hash of the archive to whose runs an archive has added formulas, at its root.
FORMULAS_OVER = "formulas_over"

# What the runs of a model depend on besides their inputs, a line each: at the root of an archive,
# or at the group of the model in an archive of several.
DEPENDENCIES = "run_dependencies"

# An archive of a benchmark of methods: the kind of the source that errors are measured from (its
# name as well, unless a method of the study has that), the group of what is said of several methods
# at once, and its dimensions.
REFERENCE = "reference"
COMPARISON_GROUP = "comparison"
VARIANT = "variant"
BUDGET = "budget"
# Of a method, an attribute: the comparisons that it takes part in. Along the budgets: the runs that
# it makes, and its replicates.
VARIANTS = "variants"
RUNS_OF_BUDGET = "runs"
REPLICATES_OF_BUDGET = "replicates"

# Use of the points of a design: as one set, or as replicates whose scatter gives the error.
SINGLE = "single"
REPLICATED = "replicated"

# Size of a design in a rehearsal: as its study states it, and that of all others.
STATED = "stated"
EQUAL = "equal"

MODELS = "models"
DIFFERENCES = "differences"
MODEL_FORM = "model_form"
# Of the statistics of an output: what a reader has to mind of it, as the study states it.
CAVEAT = "caveat"
# Likewise: "log" for charts by its logarithm.
AXIS_SCALE = "axis_scale"
LOGARITHMIC = "log"

# Names that the datasets of an archive use themselves.
RESERVED = frozenset(
    (
        *(RUN, REPLICATE, ROUND, BLOCK_NUMBER, MATRIX, POSITION, QUADRATURE_WEIGHT),
        *(MOVED_INPUT, MOVED_BY, MOVED_UNCERTAINTY),
        *(SUBSET_LEVEL, CHAIN_PARENT, LEVEL_THRESHOLD, SAMPLING_STAGE, MIXTURE_COMPONENT),
        *(DENSITY_RATIO, SEARCH_START, SEARCH_ORIGIN, MOVED_AXIS, NORMAL_DISTANCE),
        *(CORRECTION_WEIGHT, SEARCH_WEIGHT, PREDICTED_EVENT, PREDICTION_ERROR),
        *(BOUND_SEARCH, BOUNDED_QUANTITY, BOUND_END, PREDICTED_DISTANCE),
        *(SURROGATE_PROBABILITY, SURROGATE_PROBABILITY_ERROR, STATUS, FAILED_RUN, FAILURE_REASON),
        *(BOUND, INPUT, RANK, PRINCIPAL_COMPONENT),
    )
)

# Of the fit to an output: what it predicts at the inputs of the failed training runs. Their number,
# the range of the predictions in the unit of the output, thresholds with ``>`` or ``<`` before
# them, and the shares of the predictions beyond these.
MISSING_PREDICTED = "missing_runs_predicted"
MISSING_LOWEST = "missing_runs_lowest"
MISSING_HIGHEST = "missing_runs_highest"
MISSING_BEYOND = "missing_runs_beyond"
MISSING_SHARES = "missing_runs_shares"


# Names of the dimensions that entries of statistics lie along.
PROBABILITY = "probability"
# The share of the distribution that an upper tolerance limit covers, a lower one, an interval.
CONTENT_LEVEL = "content"
LOWER_CONTENT = "lower_content"
INTERVAL_CONTENT = "interval_content"
# The share of all curves that a tolerance band holds.
BAND_CONTENT = "band_content"
# The probability below the quantile that an expected shortfall lies beyond.
SHORTFALL_LEVEL = "shortfall_level"
# The number of cases in which a return level is exceeded once on average.
RETURN_PERIOD = "return_period"
THRESHOLD = "threshold"
# A threshold to lie below; the thresholds to exceed may be others.
LOWER_THRESHOLD = "lower_threshold"
CATEGORY = "category"
# An event whose probability has bounds over intervals.
BOUNDED_EVENT = "bounded_event"
# A measured value that a model is compared with, by its number.
MEASURED_ROW = "measured_row"
# A row of the measurements in which nothing was measured, by its number among these.
BLANK_ROW = "blank_row"
# A condition of it, or a dimension along which it has a place.
MEASURED_CONDITION = "measured_condition"
# An event of several outputs.
EVENT = "event"
# An event whose sensitivities to the inputs' distributions a study requests.
SENSITIVITY_EVENT = "sensitivity_event"
# A design point of a rare event, by its number; the nearest to the median comes first.
DESIGN_POINT = "design_point"
# An unknown of a fit to measurements, and the same as the second one of a pair.
UNKNOWN = "unknown_input"
OTHER_UNKNOWN = "other_unknown_input"
# A combination of unknowns that is known independently of others, by its number.
COMBINATION = "unknown_combination"
# A minimum of the sum of squares, by its number; the lowest comes first.
MINIMUM = "fit_minimum"
# Dimension of the parts of an output's distribution, each by the probability below its middle.
OUTPUT_SHARE = "output_share"
# The same of the parts of an input's distribution.
INPUT_SHARE = "input_share"
PERCENT = "percent"
RUNS_SO_FAR = "runs_so_far"
# Numbers of specimens that an input might be fitted to, as texts.
SPECIMENS = "specimens"
# A curve or field of a run, by the number of the run.
CURVE = "curve"
