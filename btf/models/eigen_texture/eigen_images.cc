// SPDX-License-Identifier: Apache-2.0
#include "btf/models/eigen_texture/eigen_images.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "base/parallel.h"
#include "btf/models/matrix_product.h"

namespace veneer::btf {
namespace {

constexpr int kCodes = 255;  // steps from the first code to the last
// Texels read at once: 20 MB of the Bonn sets.
constexpr int kBlock = 256;

// Eigenvalues under this part of the largest are rounding.
constexpr double kRankTolerance = 1e-12;

using Gram = Eigen::MatrixXd;
using Samples = Eigen::Map<const RowMatrix>;  // of a texel and view: [light][channel]

// The range of an image, which holds 0.
struct Range {
  float least = 0.0F;
  float most = 0.0F;
};

// A view's lights x lights products over all texels and channels. Every view adds up texels in
// their order, so that threads change nothing.
std::vector<Gram> gram_matrices(const SampleSet& set,
                                const FittedPairs& pairs,
                                Progress& progress) {
  const MaterialFrame& info = pairs.frame();
  const auto lights = static_cast<Eigen::Index>(info.lights.size());
  const auto views = static_cast<std::int64_t>(info.views.size());
  const auto values = static_cast<std::size_t>(info.pair_count()) * 3;
  std::vector<Gram> grams(info.views.size(), Gram::Zero(lights, lights));
  std::vector<float> block(static_cast<std::size_t>(std::min(kBlock, info.texel_count())) * values);
  progress.start("products of lights", info.texel_count());
  for (int first = 0; first < info.texel_count(); first += kBlock) {
    const int count = std::min(kBlock, info.texel_count() - first);
    parallel_for(count, 8, [&](std::int64_t begin, std::int64_t end) {
      for (auto i = static_cast<int>(begin); i < end; ++i)
        pairs.rgb(set,
                  first + i,
                  Part::kTotal,
                  std::span(block).subspan(static_cast<std::size_t>(i) * values, values));
    });
    parallel_for(views, 1, [&](std::int64_t begin, std::int64_t end) {
      Eigen::MatrixXd columns(lights, 3 * count);
      for (auto view = static_cast<Eigen::Index>(begin); view < end; ++view) {
        for (int i = 0; i < count; ++i)
          columns.middleCols(3 * i, 3) =
              Samples(&block[static_cast<std::size_t>(i) * values] + view * lights * 3, lights, 3)
                  .cast<double>();
        grams[static_cast<std::size_t>(view)].selfadjointView<Eigen::Lower>().rankUpdate(columns);
      }
    });
    progress.advance(count);
  }
  progress.finish();
  return grams;
}

// How a view's pictures make its images, and these the pictures again: [component][light].
struct Basis {
  RowMatrix project;
  RowMatrix rebuild;
};

// The strongest eigenvectors as rows, zero beyond the matrix's size.
Basis eigenvectors(const Gram& gram, int components) {
  const Eigen::SelfAdjointEigenSolver<Gram> solver(gram);  // reads the lower half
  RowMatrix rows = RowMatrix::Zero(components, gram.rows());
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(components, gram.rows()); ++i)
    rows.row(i) = solver.eigenvectors().col(gram.cols() - 1 - i).transpose().cast<float>();
  return {rows, rows};
}

// The same with lights scaled by `roots`, the square roots of their weights. With G the Gram matrix
// and v an eigenvector of D G D to the value c, images are made by D v, and G D v / c is what they
// explain of every light: v / root where that is not 0.
Basis weighted_eigenvectors(const Gram& gram, const Eigen::VectorXd& roots, int components) {
  const Gram whole = gram.selfadjointView<Eigen::Lower>();
  const Eigen::SelfAdjointEigenSolver<Gram> solver(roots.asDiagonal() * whole * roots.asDiagonal());
  Basis basis{RowMatrix::Zero(components, gram.rows()), RowMatrix::Zero(components, gram.rows())};
  const Eigen::VectorXd& values = solver.eigenvalues();
  const Eigen::Index last = gram.cols() - 1;
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(components, gram.rows()); ++i) {
    if (!(values[last - i] > kRankTolerance * values[last])) break;
    const Eigen::VectorXd project = roots.cwiseProduct(solver.eigenvectors().col(last - i));
    basis.project.row(i) = project.transpose().cast<float>();
    basis.rebuild.row(i) = (whole * project / values[last - i]).transpose().cast<float>();
  }
  return basis;
}

// Calls use(texel, images) for all, with images [view, component][channel]; from several threads.
template <class Use>
void project(const SampleSet& set,
             const FittedPairs& pairs,
             const std::vector<Basis>& bases,
             std::string_view label,
             Progress& progress,
             const Use& use) {
  const MaterialFrame& info = pairs.frame();
  const auto lights = static_cast<Eigen::Index>(info.lights.size());
  const auto views = static_cast<Eigen::Index>(bases.size());
  const auto components = bases.front().project.rows();
  progress.start(label, info.texel_count());
  parallel_for(info.texel_count(), 16, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(static_cast<std::size_t>(info.pair_count()) * 3);
    RowMatrix images(views * components, 3);
    for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
      pairs.rgb(set, texel, Part::kTotal, rgb);
      for (Eigen::Index view = 0; view < views; ++view)
        images.middleRows(view * components, components).noalias() =
            bases[static_cast<std::size_t>(view)].project *
            Samples(rgb.data() + view * lights * 3, lights, 3);
      use(texel, images);
    }
    progress.advance(end - begin);
  });
  progress.finish();
}

// [view, component]
std::vector<Range> ranges_of(const SampleSet& set,
                             const FittedPairs& pairs,
                             const std::vector<Basis>& bases,
                             Progress& progress) {
  std::vector<Range> ranges(bases.size() * static_cast<std::size_t>(bases.front().project.rows()));
  std::mutex mutex;
  project(set, pairs, bases, "ranges", progress, [&](int, const RowMatrix& images) {
    const std::lock_guard lock(mutex);
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const auto image = images.row(static_cast<Eigen::Index>(i));
      ranges[i].least = std::min(ranges[i].least, image.minCoeff());
      ranges[i].most = std::max(ranges[i].most, image.maxCoeff());
    }
  });
  return ranges;
}

// Between two codes, so that the range fits around the code of 0; infinite if it cannot.
float step_of(const Range& range, int zero) {
  const float above = range.most / static_cast<float>(kCodes - zero);
  if (range.least == 0.0F) return above;
  return zero == 0 ? std::numeric_limits<float>::infinity()
                   : std::max(above, -range.least / static_cast<float>(zero));
}

// The code of 0 with the smallest squared roundings over all views; eigenvectors have length 1, so
// that every view's count alike.
int best_zero(const std::vector<Range>& ranges, std::size_t component, std::size_t components) {
  int best = EigenImages::kMostZero;
  double least = std::numeric_limits<double>::infinity();
  for (int zero = 0; zero <= EigenImages::kMostZero; ++zero) {
    double sum = 0.0;
    for (std::size_t i = component; i < ranges.size(); i += components)
      sum += std::pow(double(step_of(ranges[i], zero)), 2.0);
    if (sum < least) {
      least = sum;
      best = zero;
    }
  }
  return best;
}

}  // namespace

Eigen::Vector3d EigenImages::image(std::size_t view_and_texel, int component) const {
  const std::size_t at =
      view_and_texel * static_cast<std::size_t>(values()) + 3 * static_cast<std::size_t>(component);
  if (precision == Precision::kFloat16)
    return Eigen::Map<const Eigen::Matrix<Eigen::half, 3, 1>>(&halves[at]).cast<double>();
  return (Eigen::Map<const Eigen::Matrix<std::uint8_t, 3, 1>>(&codes[at]).cast<double>().array() -
          zeros[static_cast<std::size_t>(component)]) /
         double(kCodes);
}

EigenImages fit_eigen_images(const SampleSet& set,
                             const FittedPairs& pairs,
                             int components,
                             Precision precision,
                             Progress& progress) {
  const std::vector<Gram> grams = gram_matrices(set, pairs, progress);
  const std::span<const float> weights = pairs.weights();
  std::vector<Basis> bases(grams.size());
  parallel_for(
      static_cast<std::int64_t>(grams.size()), 1, [&](std::int64_t begin, std::int64_t end) {
        for (auto view = static_cast<std::size_t>(begin); view < static_cast<std::size_t>(end);
             ++view) {
          const auto lights = static_cast<std::size_t>(grams[view].rows());
          const bool alike =
              weights.empty() || std::ranges::all_of(weights.subspan(view * lights, lights),
                                                     [](float w) { return w == 0.0F; });
          bases[view] = alike
                            ? eigenvectors(grams[view], components)
                            : weighted_eigenvectors(grams[view],
                                                    Eigen::Map<const Eigen::ArrayXf>(
                                                        &weights[view * lights], grams[view].rows())
                                                        .cast<double>()
                                                        .sqrt(),
                                                    components);
        }
      });

  std::vector<Range> ranges = ranges_of(set, pairs, bases, progress);
  const auto count = static_cast<std::size_t>(components);
  // An eigenvector's sign is free: the larger end of the range is made the upper one.
  for (std::size_t i = 0; i < ranges.size(); ++i)
    if (-ranges[i].least > ranges[i].most) {
      ranges[i] = {-ranges[i].most, -ranges[i].least};
      for (RowMatrix* rows : {&bases[i / count].project, &bases[i / count].rebuild})
        rows->row(static_cast<Eigen::Index>(i % count)) *= -1.0F;
    }

  const bool bytes = precision == Precision::k8Bit;
  EigenImages images;
  images.components = components;
  images.precision = precision;
  // What a stored value of 1 stands for.
  std::vector<float> scales(ranges.size());
  for (std::size_t i = 0; i < count && bytes; ++i)
    images.zeros.push_back(static_cast<std::uint8_t>(best_zero(ranges, i, count)));
  for (std::size_t i = 0; i < ranges.size(); ++i)
    scales[i] =
        bytes ? float(kCodes) * step_of(ranges[i], images.zeros[i % count]) : ranges[i].most;
  for (std::size_t view = 0; view < bases.size(); ++view)
    for (Eigen::Index light = 0; light < bases[view].rebuild.cols(); ++light)
      for (std::size_t i = 0; i < count; ++i)
        images.weights.push_back(saturated_half(
            scales[view * count + i] * bases[view].rebuild(static_cast<Eigen::Index>(i), light)));

  const auto texels = static_cast<std::size_t>(pairs.frame().texel_count());
  const std::size_t all = bases.size() * texels * static_cast<std::size_t>(images.values());
  if (bytes) {
    images.codes.resize(all);
  } else {
    images.halves.resize(all);
  }
  const auto values = static_cast<std::size_t>(images.values());
  project(
      set, pairs, bases, "Eigen-textures", progress, [&](int texel, const RowMatrix& projected) {
        for (std::size_t i = 0; i < scales.size(); ++i) {
          const std::size_t out =
              (i / count * texels + static_cast<std::size_t>(texel)) * values + i % count * 3;
          const float shrink = scales[i] > 0.0F ? 1.0F / scales[i] : 0.0F;
          for (std::size_t c = 0; c < 3; ++c) {
            const float value =
                shrink * projected(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c));
            if (bytes) {
              const auto code = images.zeros[i % count] + std::lround(float(kCodes) * value);
              images.codes[out + c] = static_cast<std::uint8_t>(std::clamp<long>(code, 0, kCodes));
            } else {
              images.halves[out + c] = Eigen::half(value);
            }
          }
        }
      });
  return images;
}

}  // namespace veneer::btf
