// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/stokes_image.h"

#include <array>
#include <vector>

#include "base/statistics.h"
#include "capture/polarisation/stokes.h"

namespace veneer::capture {

Result<StokesImage> stokes_image(const MosaicCells& cells, double extinction) {
  VENEER_ASSIGN(const StokesSolver solver, StokesSolver::create(mosaic_angles(), extinction));
  const int width = cells.saturated.width();
  const int height = cells.saturated.height();
  StokesImage image;
  for (Image<Rgb32f>* plane : {&image.s0, &image.s1, &image.s2, &image.redundancy})
    *plane = Image<Rgb32f>(width, height);
  image.saturated = cells.saturated;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        std::array<double, 4> readings{};
        for (std::size_t angle = 0; angle < 4; ++angle)
          readings[angle] = cells.counts[angle](x, y)[channel];
        const LinearStokes stokes = solver.solve(readings);
        image.s0(x, y)[channel] = static_cast<float>(stokes[0]);
        image.s1(x, y)[channel] = static_cast<float>(stokes[1]);
        image.s2(x, y)[channel] = static_cast<float>(stokes[2]);
        image.redundancy(x, y)[channel] =
            static_cast<float>((readings[0] + readings[2]) - (readings[1] + readings[3]));
      }
    }
  }
  return image;
}

PolarisationSummary summarise(const StokesImage& image, double least_s0) {
  constexpr int kGreen = 1;
  PolarisationSummary summary;
  std::vector<double> degrees;
  std::vector<double> residuals;
  std::size_t saturated = 0;
  for (int y = 0; y < image.saturated.height(); ++y) {
    for (int x = 0; x < image.saturated.width(); ++x) {
      if (image.saturated(x, y) != 0) {
        ++saturated;
        continue;
      }
      const double s0 = image.s0(x, y)[kGreen];
      if (!(s0 >= least_s0) || !(s0 > 0)) continue;
      degrees.push_back(
          degree_of_polarisation({s0, image.s1(x, y)[kGreen], image.s2(x, y)[kGreen]}));
      residuals.push_back(image.redundancy(x, y)[kGreen] / s0);
    }
  }
  if (!image.saturated.empty())
    summary.saturated_fraction =
        static_cast<double>(saturated) / static_cast<double>(image.saturated.pixels().size());
  summary.cells_used = degrees.size();
  summary.dolp_p50 = quantile(degrees, 0.5);
  summary.dolp_p95 = quantile(degrees, 0.95);
  summary.dolp_p999 = quantile(std::move(degrees), 0.999);
  summary.residual_median = quantile(std::move(residuals), 0.5);
  return summary;
}

}  // namespace veneer::capture
