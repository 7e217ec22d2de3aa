// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/icc.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "base/files.h"
#include "calibration/exchange/internal_lcms.h"

namespace veneer::calibration {
namespace {

/// What readers put up with, and finer than any projector's codes need.
constexpr int kMostCurveEntries = 4096;
/// XYZ in 16 bits of a version 2 profile: 65535 stands for 1 + 32767 / 32768.
constexpr double kLargestXyz = 1.0 + 32767.0 / 32768.0;

const Xyz& d50() {
  static const Xyz kD50{cmsD50X, cmsD50Y, cmsD50Z};
  return kD50;
}

cmsCIEXYZ to_lcms(const Xyz& xyz) { return {xyz.x(), xyz.y(), xyz.z()}; }

std::uint16_t to_16_bits(double part) {
  return static_cast<std::uint16_t>(std::lround(std::clamp(part, 0.0, 1.0) * 65535.0));
}

/// `curve` at a position in [0, 1], linear between its entries.
double curve_at(const std::vector<double>& curve, double position) {
  const double scaled = position * static_cast<double>(curve.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(scaled), curve.size() - 2);
  const double part = scaled - static_cast<double>(i);
  return (1 - part) * curve[i] + part * curve[i + 1];
}

ToneCurve tone_curve(const LcmsContext& lcms, const std::vector<double>& curve) {
  const int size = std::min(static_cast<int>(curve.size()), kMostCurveEntries);
  std::vector<std::uint16_t> entries;
  for (int i = 0; i < size; ++i)
    entries.push_back(to_16_bits(curve_at(curve, static_cast<double>(i) / (size - 1))));
  return ToneCurve(cmsBuildTabulatedToneCurve16(
      lcms.context(), static_cast<cmsUInt32Number>(size), entries.data()));
}

Status check(const IccSource& source) {
  if (source.description.empty() ||
      !std::ranges::all_of(source.description, [](char c) { return c >= ' ' && c <= '~'; }))
    return fail(Errc::kBadFormat, "making an ICC profile: the description is not plain ASCII");
  for (const std::vector<double>& curve : source.tone_curves)
    if (curve.size() < 2 || curve.size() > 65536 ||
        !std::ranges::all_of(curve, [](double t) { return t >= 0 && t <= 1; }))
      return fail(Errc::kBadFormat,
                  "making an ICC profile: a tone curve has {} values, or some outside of 0 to 1; "
                  "2 to 65536 are needed",
                  curve.size());
  if (!source.primaries.allFinite() || std::abs(source.primaries.determinant()) == 0)
    return fail(Errc::kBadFormat,
                "making an ICC profile: the primaries are not finite or lie in one plane");
  if (source.forward && (source.grid_nodes < 2 || source.grid_nodes > 65))
    return fail(Errc::kBadFormat,
                "making an ICC profile: the grid has {} nodes along an axis, not 2 to 65",
                source.grid_nodes);
  return {};
}

Xyz white_of(const IccSource& source) {
  return source.forward ? source.forward(Eigen::Vector3d::Ones())
                        : Xyz(source.primaries.rowwise().sum());
}

/// The grid, as curves that do nothing, nodes that hold the cube root of XYZ, and curves that take
/// them to the third power: so that what is linear between nodes is about lightness.
Result<Pipeline> grid_of(const LcmsContext& lcms,
                         const IccSource& source,
                         const Eigen::Matrix3d& pcs_from_nits) {
  const int n = source.grid_nodes;
  std::vector<std::uint16_t> nodes;
  for (int r = 0; r < n; ++r)  // blue fastest, as the format has it
    for (int g = 0; g < n; ++g)
      for (int b = 0; b < n; ++b) {
        const Xyz xyz = pcs_from_nits * source.forward(Eigen::Vector3d(r, g, b) / (n - 1));
        if (!xyz.allFinite())
          return fail(Errc::kBadFormat,
                      "making an ICC profile: the model gives no number for the drive {} {} {}",
                      static_cast<double>(r) / (n - 1),
                      static_cast<double>(g) / (n - 1),
                      static_cast<double>(b) / (n - 1));
        for (int c = 0; c < 3; ++c)
          nodes.push_back(to_16_bits(std::cbrt(std::max(xyz(c), 0.0) / kLargestXyz)));
      }
  std::vector<double> straight{0.0, 1.0};
  std::vector<double> cubes;
  for (int i = 0; i < kMostCurveEntries; ++i)
    cubes.push_back(std::pow(static_cast<double>(i) / (kMostCurveEntries - 1), 3));
  const ToneCurve in = tone_curve(lcms, straight);
  const ToneCurve out = tone_curve(lcms, cubes);
  Pipeline pipeline(cmsPipelineAlloc(lcms.context(), 3, 3));
  if (!in || !out || !pipeline)
    return fail(Errc::kBadFormat, "making an ICC profile: {}", lcms.message());
  const std::array<cmsToneCurve*, 3> ins{in.get(), in.get(), in.get()};
  const std::array<cmsToneCurve*, 3> outs{out.get(), out.get(), out.get()};
  for (cmsStage* stage :
       {cmsStageAllocToneCurves(lcms.context(), 3, ins.data()),
        cmsStageAllocCLut16bit(lcms.context(), static_cast<cmsUInt32Number>(n), 3, 3, nodes.data()),
        cmsStageAllocToneCurves(lcms.context(), 3, outs.data())}) {
    if (stage == nullptr || cmsPipelineInsertStage(pipeline.get(), cmsAT_END, stage) == 0)
      return fail(Errc::kBadFormat, "making an ICC profile: {}", lcms.message());
  }
  return pipeline;
}

}  // namespace

Eigen::Matrix3d bradford_adaptation(const Xyz& from, const Xyz& to) {
  VENEER_CHECK(from.minCoeff() > 0 && to.minCoeff() > 0);
  Eigen::Matrix3d cones_from_xyz;
  cones_from_xyz << 0.8951, 0.2664, -0.1614,  //
      -0.7502, 1.7135, 0.0367,                //
      0.0389, -0.0685, 1.0296;
  const Eigen::Vector3d gain = (cones_from_xyz * to).array() / (cones_from_xyz * from).array();
  return cones_from_xyz.inverse() * gain.asDiagonal() * cones_from_xyz;
}

Result<std::string> icc_bytes(const IccSource& source) {
  VENEER_TRY(check(source));
  const Xyz white = white_of(source);
  if (!white.allFinite() || !(white.minCoeff() > 0))
    return fail(Errc::kBadFormat,
                "making an ICC profile: white is {} {} {}; all of X, Y and Z must be above 0",
                white.x(),
                white.y(),
                white.z());
  const Eigen::Matrix3d adaptation = bradford_adaptation(white / white.y(), d50());
  const Eigen::Matrix3d pcs_from_nits = adaptation / white.y();
  if (!adaptation.allFinite())
    return fail(Errc::kBadFormat,
                "making an ICC profile: white is a colour that no eye could adapt to; see that "
                "the readings are right");

  const LcmsContext lcms;
  const IccProfile owner(cmsCreateProfilePlaceholder(lcms.context()));
  cmsHPROFILE const profile = owner.get();
  cmsSetProfileVersion(profile, 2.4);
  cmsSetDeviceClass(profile, cmsSigDisplayClass);
  cmsSetColorSpace(profile, cmsSigRgbData);
  cmsSetPCS(profile, cmsSigXYZData);
  cmsSetHeaderRenderingIntent(profile, INTENT_RELATIVE_COLORIMETRIC);

  bool ok = true;
  const auto write = [&](cmsTagSignature tag, const void* value) {
    ok = ok && cmsWriteTag(profile, tag, value) != 0;
  };
  const IccText description(cmsMLUalloc(lcms.context(), 1));
  const IccText copyright(cmsMLUalloc(lcms.context(), 1));
  ok = cmsMLUsetASCII(description.get(), "en", "US", source.description.c_str()) != 0 &&
       cmsMLUsetASCII(copyright.get(), "en", "US", "No copyright, use freely") != 0;
  write(cmsSigProfileDescriptionTag, description.get());
  write(cmsSigCopyrightTag, copyright.get());
  const cmsCIEXYZ white_point = to_lcms(d50());
  write(cmsSigMediaWhitePointTag, &white_point);
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = adaptation;
  write(cmsSigChromaticAdaptationTag, rows.data());
  const cmsCIEXYZ luminance = to_lcms({0, white.y(), 0});
  write(cmsSigLuminanceTag, &luminance);
  const Eigen::Matrix3d colorants = pcs_from_nits * source.primaries;
  constexpr std::array kColorants{
      cmsSigRedColorantTag, cmsSigGreenColorantTag, cmsSigBlueColorantTag};
  constexpr std::array kCurves{cmsSigRedTRCTag, cmsSigGreenTRCTag, cmsSigBlueTRCTag};
  for (std::size_t c = 0; c < 3; ++c) {
    const cmsCIEXYZ colorant = to_lcms(colorants.col(static_cast<Eigen::Index>(c)));
    write(kColorants[c], &colorant);
    const ToneCurve curve = tone_curve(lcms, source.tone_curves[c]);
    write(kCurves[c], curve.get());
  }
  if (source.forward) {
    VENEER_ASSIGN(const Pipeline grid, grid_of(lcms, source, pcs_from_nits));
    write(cmsSigAToB0Tag, grid.get());
  }
  cmsUInt32Number size = 0;
  ok = ok && cmsSaveProfileToMem(profile, nullptr, &size) != 0;
  std::string bytes(size, '\0');
  ok = ok && cmsSaveProfileToMem(profile, bytes.data(), &size) != 0;
  if (!ok) return fail(Errc::kBadFormat, "making an ICC profile: {}", lcms.message());
  return bytes;
}

Status write_icc(const std::filesystem::path& path, const IccSource& source) {
  VENEER_ASSIGN(const std::string bytes, icc_bytes(source));
  return write_text(path, bytes);
}

Result<std::vector<Lab>> evaluate_icc(std::string_view profile,
                                      std::span<const Eigen::Vector3d> drives) {
  const LcmsContext lcms;
  const IccProfile in(cmsOpenProfileFromMemTHR(
      lcms.context(), profile.data(), static_cast<cmsUInt32Number>(profile.size())));
  if (!in)
    return fail(Errc::kBadFormat,
                "reading an ICC profile: {}; see that it is a whole .icc",
                lcms.message());
  if (cmsGetColorSpace(in.get()) != cmsSigRgbData ||
      cmsGetDeviceClass(in.get()) != cmsSigDisplayClass)
    return fail(Errc::kBadFormat,
                "reading an ICC profile: it is not that of an RGB display; see that it is the "
                "right file");
  const IccProfile lab(cmsCreateLab4ProfileTHR(lcms.context(), nullptr));
  const IccTransform transform(cmsCreateTransformTHR(lcms.context(),
                                                     in.get(),
                                                     TYPE_RGB_DBL,
                                                     lab.get(),
                                                     TYPE_Lab_DBL,
                                                     INTENT_RELATIVE_COLORIMETRIC,
                                                     cmsFLAGS_NOOPTIMIZE | cmsFLAGS_NOCACHE));
  if (!transform)
    return fail(Errc::kBadFormat,
                "reading an ICC profile: {}; see that it is a whole .icc",
                lcms.message());
  std::vector<Lab> result;
  for (const Eigen::Vector3d& drive : drives) {
    const std::array<double, 3> rgb{drive.x(), drive.y(), drive.z()};
    cmsCIELab value{};
    cmsDoTransform(transform.get(), rgb.data(), &value, 1);
    result.push_back({value.L, value.a, value.b});
  }
  return result;
}

}  // namespace veneer::calibration
