// G+Smo's adaptive fitting with parameter correction, iteration by iteration, with the user time since the points were
// read: what `cargo xtask tables moving --gismo` runs beside ours. Built by build_gismo_fitting.sh.
//
//     gismo_fitting cloud.csv TOLERANCE ELEMENTS CORRECTIONS DEGREE LAMBDA EXTENSION ITERATIONS DOFS
//
// The file has the columns u, v, x, y, z below a header, parameters in the unit square. The loop ends when all points are
// within the tolerance, after so many iterations, or beyond so many control points. A line an iteration: control points,
// largest error, seconds.

#include <gismo.h>

#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

static double seconds()
{
    rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return double(usage.ru_utime.tv_sec) + 1e-6 * double(usage.ru_utime.tv_usec);
}

int main(int argc, char* argv[])
{
    if (argc != 10) {
        std::cerr << "nine arguments are needed\n";
        return 2;
    }
    std::ifstream file(argv[1]);
    std::vector<real_t> numbers;
    std::string line;
    std::getline(file, line);
    while (std::getline(file, line)) {
        std::replace(line.begin(), line.end(), ',', ' ');
        std::istringstream row(line);
        for (real_t number; row >> number;)
            numbers.push_back(number);
    }
    if (numbers.empty() || numbers.size() % 5 != 0) {
        std::cerr << argv[1] << " has no rows of five numbers\n";
        return 2;
    }
    const real_t tolerance = std::atof(argv[2]), lambda = std::atof(argv[6]);
    const int elements = std::atoi(argv[3]), corrections = std::atoi(argv[4]), degree = std::atoi(argv[5]);
    const unsigned extension = std::atoi(argv[7]);
    const int iterations = std::atoi(argv[8]), dofs = std::atoi(argv[9]);
    const gismo::gsMatrix<> columns = gismo::gsAsConstMatrix<>(numbers, 5, numbers.size() / 5);
    gismo::gsMatrix<> parameters = columns.topRows(2), points = columns.bottomRows(3);

    const double start = seconds();
    const gismo::gsKnotVector<> knots(0, 1, elements - 1, degree + 1);
    const gismo::gsTensorBSplineBasis<2> tensor(knots, knots);
    gismo::gsTHBSplineBasis<2> basis(tensor);
    const std::vector<unsigned> extensions(2, extension);
    gismo::gsHFitting<2, real_t> fitting(parameters, points, basis, 0.0, extensions, lambda);
    for (int i = 0; i <= iterations; ++i) {
        try {
            if (!fitting.nextIteration(tolerance, tolerance, corrections))
                break;
        } catch (const std::runtime_error&) {
            // No further level.
            break;
        }
        const auto size = fitting.result()->basis().size();
        std::cout << size << ' ' << fitting.maxPointError() << ' ' << seconds() - start
                  << std::endl;
        if (fitting.maxPointError() <= tolerance || size > dofs)
            break;
    }
}
