// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/colour.h"
#include "base/image.h"
#include "base/mesh.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "simulation/bench/truth.h"

namespace veneer::simulation {

/// What an eye pixel sees.
enum class Coverage : std::uint8_t {
  kOutside,  ///< nothing of the object
  kUnlit,    ///< only object, none of it lit by the projector
  kPartial,  ///< an edge of the object
  kCovered,  ///< only object, at least a part of it lit
};

/// One ray of an eye pixel that met the object.
struct EyeSample {
  std::uint32_t triangle = 0;
  float u = 0, v = 0;  ///< barycentric weights of the triangle's second and third corner
  std::int32_t raster_pixel = -1;  ///< row * width + column of what lights it; -1: nothing does
  float geometry = 0;              ///< G, see Bench
  bool painted = false;            ///< see ObjectTruth::painted
};

/// Where the rays of an eye's picture end. Made once a pose; what is sent along them is asked for
/// afterwards, for as many frames and materials as one likes.
struct EyeView {
  RigidTransform world_from_object;
  Eigen::Vector3d eye_in_object = Eigen::Vector3d::Zero();
  int rays_per_pixel = 0;
  Image<Coverage> coverage;
  /// Samples of pixel i (row by row): [first[i], first[i + 1]) of samples. Rays past the object
  /// have none.
  std::vector<std::uint32_t> first;
  std::vector<EyeSample> samples;

  [[nodiscard]] int width() const { return coverage.width(); }
  [[nodiscard]] int height() const { return coverage.height(); }
};

/// The material that the object should seem to be made of.
struct TexelSource {
  int width = 0;   ///< texels
  int height = 0;  ///< texels
  /// RGB of texel row * width + column for unit directions in the local frame (z normal, x towards
  /// growing columns, y = z cross x), in the unit of a sample set: pi f_r cos(theta_l).
  /// Thread-safe.
  std::function<Eigen::Vector3d(
      int texel, const Eigen::Vector3d& view, const Eigen::Vector3d& light)>
      radiance;
};

/// A light of the world in which the material is meant to be.
struct BenchLight {
  enum class Kind { kDirectional, kPoint };
  Kind kind = Kind::kDirectional;
  Eigen::Vector3d vector{0, 0, 1};  ///< world: direction to the light, or its position in metres
  Eigen::Vector3d rgb{1, 1, 1};     ///< linear sRGB: lux on a plane facing it, or candela
};

/// dE00 over a set of pixels; zero where there are none.
struct DifferenceStatistics {
  std::int64_t count = 0;
  double mean = 0;
  double p95 = 0;
  double max = 0;
};

/// What the eye received held against what the material would have sent. All pixels that lie
/// wholly on the object are covered, however much or little of the projector's light they get: what
/// it cannot reach is counted as out of gamut, not left out.
struct Comparison {
  Xyz white = Xyz::Zero();       ///< against which dE00 was computed, see Bench::white
  Image<float> de00;             ///< NaN where the pixel is not wholly on the object
  Image<std::uint8_t> in_gamut;  ///< 1 where covered and reachable by the hidden truth
  DifferenceStatistics within_gamut;
  DifferenceStatistics covered;
  double in_gamut_fraction = 0;  ///< of the covered pixels
  std::int64_t partial = 0;      ///< pixels left out because they lie on an edge of the object
  std::int64_t unlit = 0;        ///< covered pixels that get no light of the projector
  std::int64_t target_over_white = 0;  ///< covered pixels with L* > 100
  std::int64_t received_over_white = 0;
};

/// The virtual bench: a projector, an object, a room and an observer's eye whose true parameters
/// compensation never sees. It computes in 31 spectral bands and shares no physics with render/ or
/// calibration/. Thread-safe after construction.
///
/// The light of one surface point is, per wavelength,
///   L = albedo [ G (sum over outputs of output * primary + black) + ambient ],
///   G = cos(theta_p) (r_ref / r)^2 vignetting(pixel),
/// with theta_p and r the slant and the distance of the lens (a point), primary, black and ambient
/// the radiance of a perfect diffuser, G = 0 in shadow and off the raster. Raster pixels are boxes:
/// a point gets the (blurred) light of the pixel whose box its ray leaves through. The surface is
/// Lambertian and of one albedo, or of two where it has a texture, so that summing the bands once
/// for each, before geometry, is exact. The
/// lamp is settled, except where a light is asked for with a part of it. Left out: light between
/// parts of a concave object, light scattered in the lens beyond the blur.
class Bench {
 public:
  /// Errors: those of BenchTruth::load and load_mesh.
  [[nodiscard]] static Result<std::unique_ptr<Bench>> load(const std::filesystem::path& bench_toml);
  /// @param mesh  taken in place of truth.object.mesh.   Errors: kInvalidOption.
  [[nodiscard]] static Result<std::unique_ptr<Bench>> create(const BenchTruth& truth, Mesh mesh);
  ~Bench();

  [[nodiscard]] const BenchTruth& truth() const;
  [[nodiscard]] const Mesh& mesh() const;

  /// Traces an eye's picture of the object: BenchTruth::eye.samples^2 rays a pixel, on a regular
  /// grid. A ray counts as lit where G > 0.
  /// Errors: kInvalidOption (a pose that is not finite, an eye at the object's origin).
  [[nodiscard]] Result<EyeView> look(const RigidTransform& world_from_object,
                                     const Eigen::Vector3d& eye_in_world) const;

  /// What the eye receives of a projected frame: XYZ in cd/m^2, mean of the pixel; the space
  /// around the object is black. Errors: kInvalidOption (size or codes do not fit the projector).
  [[nodiscard]] Result<Image<Rgb32f>> observe(const EyeView& view,
                                              ImageView<const Rgb16> codes) const;

  /// What the material would send in the same pixels along the same rays: XYZ in cd/m^2, computed
  /// in double precision. Texels are looked up nearest; uv repeats. The lights cast no shadows of
  /// the object onto itself.
  /// @param repeats  of the texture over u, v in [0, 1].
  [[nodiscard]] Image<Rgb32f> material_truth(const EyeView& view,
                                             const TexelSource& material,
                                             const Eigen::Vector2d& repeats,
                                             const std::vector<BenchLight>& lights) const;

  /// The white of colour differences: what full drive, black included and ambient light not, sends
  /// from a perfect diffuser at the object's origin that faces the projector. An origin off the
  /// raster is taken at the raster's nearest pixel. Errors: kInvalidOption (an origin behind the
  /// lens).
  [[nodiscard]] Result<Xyz> white(const RigidTransform& world_from_object) const;

  /// Whether some drive in [0,1]^3, the same over all that lights the pixel, makes the object send
  /// `xyz` (cd/m^2) where the mean geometry is `geometry`; for 0 this is what the ambient light
  /// alone sends. A hundred-thousandth of `xyz` is taken as rounding, so that the answer holds at
  /// any geometry however small.
  /// @param geometry  >= 0; false for any other, as for an `xyz` that is not finite.
  /// @param painted  part of the surface that has ObjectTruth::texture_reflectance.
  [[nodiscard]] bool reachable(const Xyz& xyz, double geometry, double painted = 0) const;

  /// @param target  what should be received, @param received  what is, both of the view's size.
  /// Errors: kInvalidOption (sizes), kBadFormat (a covered pixel that is not finite), those of
  /// white().
  [[nodiscard]] Result<Comparison> compare(const EyeView& view,
                                           const Image<Rgb32f>& target,
                                           const Image<Rgb32f>& received) const;

  /// What a flat board sends that stands square to the projector's axis, its plane at the reference
  /// distance, in the spot of a raster pixel (anywhere on the plane), the whole raster in one code.
  /// The spot is larger than the blur. XYZ in cd/m^2.
  /// @param code  below 2^bits.   @param lamp  in parts of its settled light; 0: it is off.
  /// @param of_object  the board is of the object's material, not painted, else a perfect diffuser.
  [[nodiscard]] Xyz board(const Rgb16& code,
                          const Eigen::Vector2d& pixel,
                          double lamp,
                          bool of_object) const;

  /// The point of the object that a ray meets first, and what lights it; nothing if it meets none.
  /// @param direction  any length.
  [[nodiscard]] std::optional<EyeSample> trace(const RigidTransform& world_from_object,
                                               const Eigen::Vector3d& origin_in_world,
                                               const Eigen::Vector3d& direction_in_world) const;

  /// Where the middle of what a raster position lights lies on the object, in the world; nothing
  /// where that is past the object. @param pixel  on the raster.
  [[nodiscard]] std::optional<Eigen::Vector3d> lit_point(const RigidTransform& world_from_object,
                                                         const Eigen::Vector2d& pixel) const;

 private:
  struct State;
  explicit Bench(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::simulation
