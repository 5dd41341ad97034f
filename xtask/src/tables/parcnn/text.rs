//! What stands between the tables.

pub(super) const INTRODUCTION: &str = "\
# Learned parameterization of sequences and grids

    cargo xtask tables parcnn --data DIR --train 2000

computes this page anew, from seed 41.

MSE is the mean squared distance of the points to the polynomial of least squares at their parameters, the coordinates
summed; points are scaled into the unit box by one common factor. STD is the best of uniform, centripetal and chord-length
parameters on the average of a cell. 100 items a cell. \"Shipped\" is the network that comes with `param-nn`, one for all
degrees and lengths; it is told the degree of the fit, as the published networks were trained for one degree each. The last
column is the same network followed by two steps of the joint Levenberg–Marquardt method of `moving-param`; the papers have
no such column. Factors are ours divided by the printed figure.
";

pub(super) const AFTER_TABLE_1: &str = "
MAX is the largest distance at the parameters, HSD the largest distance of a point to the curve. The printed MAX of MLP, TRA,
RES and CNN are below the roots of their MSE: they are squares, and their roots are shown.

STD: all MSE agree with the printed ones within a factor 1.6. The compared networks got so few steps that all were still
improving: RES comes within a factor 1.5 of its printed errors, the others do not come near. With 6000 steps MLP, PPN and CNN had a
fifth to two fifths of these errors, RES half. The printed TRA are the errors of uniform parameters, which on such items are 1.57e-2,
1.02e-2, 6.5e-3, 4.8e-3: layer normalization of two numbers leaves their order only, and the transformer hardly learns. The shipped
network is below the printed CNN and below STD in every row.

**The ranking of the paper, CNN first, is not reproduced** by these trainings: RES is below the CNN at every degree, at d = 2 MLP and PPN are too.
They follow our recipe, loss and optimizer, not the paper's. With the published recipe the CNN does come first, the others in another order than
printed ([published.md](published.md)).

## Table 4.2

PPN, ours: windows of 2d + 1 points, one edge apart, moved together in logarithms and averaged. With the few steps of training that it
got it is above STD; the printed figures are not reached. The shipped network is below the printed CNN and below STD in every row.

";

pub(super) const BEFORE_TABLE_3: &str = "
## Table 4.3

B-splines with 5 interior knots, inserted one by one in the middle of the interval with the largest error. Noise: standard
deviation 1e-2 in each coordinate before the points are scaled. The
network is told 6 uniform elements for trigonometric curves, one for noisy polynomials. The text does not say how far trigonometric curves
run; ours run through one radian of their lowest frequency. Over whole periods STD has a hundred times the printed errors, and even
so the printed errors of low degrees are larger than ours, those of high degrees smaller: these are not the same curves.
The shipped network is below STD in every row, and below the printed CNN in all but two, trigonometric curves with d = 2 and 50 or 80
points.
";

pub(super) const BEFORE_TABLE_4: &str = "
## Table 4.4

Grids of 12 × 12 points on random polynomial surfaces.
";

pub(super) const AFTER_TABLE_4: &str = "
The printed STD is that of centripetal parameters (factor 1.03 to 1.51). Chord length is forty to seventy times better
on the exact surfaces and ten to seventeen times on the noisy ones, so it is also better than the printed CNN; the shipped network is
better than both.
";

pub(super) const BEFORE_TABLE_5: &str = "
## Table 4.5

GT are the parameters that the points were sampled at. Car and hull with 55 × 55 points are the authors' own; their smaller
grids are not public, ours have 33 of the 55 lines in each direction. The wind turbine is not public; ours is the blade of the
IEA 15 MW turbine, another shape, so only columns of ours can be compared in its rows.

";

pub(super) const AFTER_TABLE_5: &str = "
Example 4.1.6 (g): the car with bicubic splines of 8 × 8 elements.

";

pub(super) const BEFORE_HULL: &str = "
Example 5.2.2 (b): the hull, then A-PDM. The text states no settings; ours are degree 2, 4 × 4 elements at the start, λ = 1e-7,
tolerance 5e-5, one correction a refinement: fewer control points than printed, and a larger error.

";
