// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2014/ubo2014.h"

// bzlib.h uses FILE without including what declares it.
// clang-format off
#include <cstdio>

#include <bzlib.h>
// clang-format on

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "btf/importers/internal_test_files.h"
#include "btf/importers/ubo2014/factors.h"
#include "btf/importers/ubo2014/plain.h"

namespace veneer::btf {
namespace {

using testing::put;

constexpr int kWidth = 3;
constexpr int kHeight = 2;
constexpr int kTexels = kWidth * kHeight;
constexpr int kViews = 2;
constexpr int kLights = 4;
constexpr int kPairs = kViews * kLights;
constexpr double kEpsilon = 1e-5;

double light_theta(int l) { return 0.3 * l; }

// A coloured material: linear RGB of a texel and pair.
double law(int texel, int view, int light, int c) {
  return 0.2 + 0.1 * c + 0.03 * texel + 0.05 * std::sin(1.0 + texel * (view + 2.0 * light) + c);
}

void put_scalar(std::string& bytes, double value, int size) {
  if (size == 2) put(bytes, Eigen::half(static_cast<float>(value)));
  if (size == 4) put(bytes, static_cast<float>(value));
  if (size == 8) put(bytes, value);
}

void put_matrix(std::string& bytes, const Eigen::MatrixXd& matrix, int size) {
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
      put_scalar(bytes, matrix(row, column), size);
}

std::string meta(std::uint32_t version, std::uint32_t cosine) {
  std::string body;
  put(body, version);
  body.append(240, 'm');
  put(body, 4.0F);  // texels per millimetre
  for (int c = 0; c < 3; ++c) put(body, 1.0F);
  if (version > 1) put(body, cosine);
  if (version > 2) {
    put(body, std::uint32_t{5});
    body += "<xml>";
  }
  if (version > 3) {
    put(body, std::uint32_t{3});
    for (const char* name : {"R", "G", "B"}) {
      put(body, std::uint32_t{1});
      body += name;
    }
  }
  std::string bytes;
  put(bytes, static_cast<std::uint32_t>(body.size() + 4));
  return bytes + body;
}

std::string sampling() {
  std::string bytes;
  put(bytes, std::uint32_t{kViews});
  for (int v = 0; v < kViews; ++v) {
    put(bytes, 0.5F * static_cast<float>(v));
    put(bytes, -1.0F);
    put(bytes, std::uint32_t{kLights});
    for (int l = 0; l < kLights; ++l) {
      put(bytes, static_cast<float>(light_theta(l)));
      put(bytes, 0.5F * static_cast<float>(l));
    }
  }
  return bytes;
}

std::string size_of_picture() {
  std::string bytes;
  put(bytes, std::uint32_t{kWidth});
  put(bytes, std::uint32_t{kHeight});
  return bytes;
}

std::string rotations() {
  std::string bytes;
  put(bytes, std::uint32_t{2});
  for (int i = 0; i < 18; ++i) put(bytes, 0.5F);
  return bytes;
}

std::string common(const std::string& signature, std::uint32_t version = 4, std::uint32_t cos = 1) {
  return signature + meta(version, cos) + sampling() + size_of_picture() +
         (signature.back() == 'R' ? rotations() : std::string());
}

// Two factors of a matrix, neither of them trivial: V is any regular matrix.
struct Split {
  Eigen::MatrixXd u;
  Eigen::MatrixXd v;
};
Split split(const Eigen::MatrixXd& matrix) {
  const Eigen::Index n = matrix.cols();
  Eigen::MatrixXd v = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i) v(i, (i + 1) % n) += 0.5;
  return {matrix * v.transpose().inverse(), v};
}

void put_factors(std::string& bytes, const Eigen::MatrixXd& matrix, int size) {
  const Split factors = split(matrix);
  put(bytes, static_cast<std::uint32_t>(factors.v.cols()));
  put(bytes, static_cast<std::uint32_t>(factors.u.rows()));
  put(bytes, static_cast<std::uint32_t>(factors.v.rows()));
  for (Eigen::Index i = 0; i < factors.v.cols(); ++i) put_scalar(bytes, 1.0, size);
  put_matrix(bytes, factors.u, size);
  put_matrix(bytes, factors.v, size);
}

// A value of one texel, pair and channel as it is stored.
using Stored = std::function<double(int texel, int view, int light, int c)>;

std::string fmf(const std::string& head, int size, bool turned, const Stored& stored) {
  Eigen::MatrixXd matrix(turned ? 3 * kTexels : 3 * kPairs, turned ? kPairs : kTexels);
  for (int t = 0; t < kTexels; ++t)
    for (int v = 0; v < kViews; ++v)
      for (int l = 0; l < kLights; ++l)
        for (int c = 0; c < 3; ++c) {
          const int pair = v * kLights + l;
          (turned ? matrix(3 * t + c, pair) : matrix(3 * pair + c, t)) = stored(t, v, l, c);
        }
  std::string bytes = head;
  put(bytes, static_cast<std::uint32_t>(matrix.cols()));
  put(bytes, static_cast<std::uint8_t>(size));
  put_factors(bytes, matrix, size);
  return bytes;
}

std::string extension(std::uint32_t method) {
  std::string bytes;
  put(bytes, std::uint8_t{2});
  put(bytes, method);
  put(bytes, std::uint32_t{2});
  put(bytes, std::uint32_t{3});
  return bytes.append(12, '\1');  // the height map
}

const Eigen::Matrix3d& colour_axes() {
  static const Eigen::Matrix3d axes =
      (Eigen::Matrix3d() << 0.6, 0.5, 0.4, -0.7, 0.1, 0.6, 0.2, -0.8, 0.5).finished();
  return axes;
}

// The textbook's way from RGB to a colour model of DFMF.
Eigen::Vector3d encode(int model, const Eigen::Vector3d& rgb) {
  const double r = rgb[0];
  const double g = rgb[1];
  const double b = rgb[2];
  const Eigen::Vector3d yuv(0.299 * r + 0.587 * g + 0.114 * b,
                            -0.14713 * r - 0.28886 * g + 0.436 * b,
                            0.615 * r - 0.51499 * g - 0.10001 * b);
  const double log_y = std::log(yuv[0] + kEpsilon);
  const auto signed_log = [](double x) {
    return std::copysign(std::log(std::abs(x) / kEpsilon), x);
  };
  switch (model) {
    case 1:
      return yuv;
    case 3:
      return colour_axes().transpose().inverse() * (rgb - Eigen::Vector3d(0.1, 0.2, 0.3));
    case 4:
      return {r / 4 + g / 2 + b / 4, (r - b) / 2, -r / 4 + g / 2 - b / 4};
    case 9:
      return {log_y, yuv[1], yuv[2]};
    case 10:
      return {log_y, signed_log(yuv[1]), signed_log(yuv[2])};
    case 11:
      return {log_y, yuv[1] / (yuv[0] + kEpsilon), yuv[2] / (yuv[0] + kEpsilon)};
    case 12:
      return (rgb.array() + kEpsilon).log();
    default:
      return rgb;
  }
}

std::string dfmf(std::int32_t model, int size, bool turned) {
  std::string bytes = common("!DFMF08FCR");
  put(bytes, std::uint32_t{kTexels});
  put(bytes, model);
  for (const float mean : {0.1F, 0.2F, 0.3F}) put(bytes, mean);
  put_matrix(bytes, colour_axes(), 4);
  for (int c = 0; c < 3; ++c) {
    Eigen::MatrixXd matrix(kPairs, kTexels);
    for (int t = 0; t < kTexels; ++t)
      for (int v = 0; v < kViews; ++v)
        for (int l = 0; l < kLights; ++l)
          matrix(v * kLights + l, t) =
              encode(model, {law(t, v, l, 0), law(t, v, l, 1), law(t, v, l, 2)})[c];
    if (turned) matrix.transposeInPlace();
    put(bytes, static_cast<std::uint8_t>(size));
    put_factors(bytes, matrix, size);
  }
  return bytes;
}

std::string pvf(int size, bool weights_of_texels) {
  std::string bytes = common("!PVF06FC");
  put(bytes, std::uint32_t{kTexels});
  put(bytes, std::uint32_t{kViews});
  for (int v = 0; v < kViews; ++v) {
    Eigen::MatrixXd matrix(weights_of_texels ? 3 * kLights : 3 * kTexels,
                           weights_of_texels ? kTexels : kLights);
    for (int t = 0; t < kTexels; ++t)
      for (int l = 0; l < kLights; ++l)
        for (int c = 0; c < 3; ++c)
          (weights_of_texels ? matrix(3 * l + c, t) : matrix(3 * t + c, l)) = law(t, v, l, c);
    const Eigen::VectorXd mean = matrix.rowwise().mean();
    const Split factors = split(matrix.colwise() - mean);
    put(bytes, static_cast<std::uint8_t>(size));
    put(bytes, static_cast<std::uint32_t>(factors.v.cols()));
    put(bytes, static_cast<std::uint32_t>(factors.v.rows()));
    put(bytes, static_cast<std::uint32_t>(matrix.rows()));
    for (Eigen::Index i = 0; i < factors.v.cols(); ++i) put_scalar(bytes, 1.0, size);
    put_matrix(bytes, mean, size);
    put_matrix(bytes, factors.u, size);
    put_matrix(bytes, factors.v, size);
  }
  return bytes;
}

constexpr int kMissing = 4;  // the texel that a sparse file leaves out

// Chunks of one row: where a texel is missing, the next ones move up.
std::string bdi(std::uint8_t compression, std::uint32_t cosine = 1) {
  std::string bytes = "!BDIF06R2!" + meta(4, cosine) + sampling() + size_of_picture();
  put(bytes, std::uint32_t{1});
  put(bytes, compression);
  for (int t = 0; t < kTexels; ++t)
    put(bytes, static_cast<std::uint8_t>(compression == 2 && t == kMissing ? 0 : 1));
  bytes += rotations();
  std::string chunk;
  int texels = 0;
  const auto finish_chunk = [&] {
    if (texels == 0) return;
    std::string packed = chunk;
    if (compression == 1) {
      packed.resize(chunk.size() + 1000);
      auto size = static_cast<unsigned>(packed.size());
      VENEER_CHECK(
          BZ2_bzBuffToBuffCompress(
              packed.data(), &size, chunk.data(), static_cast<unsigned>(chunk.size()), 9, 0, 0) ==
          BZ_OK);
      packed.resize(size);
    }
    put(bytes, static_cast<std::uint32_t>(packed.size()));
    bytes += packed;
    chunk.clear();
    texels = 0;
  };
  for (int t = 0; t < kTexels; ++t) {
    if (compression == 2 && t == kMissing) continue;
    for (int v = 0; v < kViews; ++v)
      for (int l = 0; l < kLights; ++l)
        for (int c = 0; c < 3; ++c) put_scalar(chunk, law(t, v, l, c), 2);
    if (++texels == kWidth) finish_chunk();
  }
  finish_chunk();
  return bytes;
}

// Rounding of the set's float16 and of the conversions; that of files in float16 grows through the
// factors (up to six terms of size 1, logarithms of size 10).
constexpr double kRounding = 1e-3;
constexpr double kHalfFile = 0.05;

void expect_law(const SampleSet& set, double error, bool multiplied = false, int missing = -1) {
  ASSERT_EQ(set.info().views.size(), std::size_t{kViews});
  ASSERT_EQ(set.info().lights.size(), std::size_t{kLights});
  EXPECT_NEAR(angles_from_direction(set.info().views[1]).theta, 0.5, 1e-6);
  EXPECT_NEAR(angles_from_direction(set.info().lights[2]).phi, 1.0, 1e-6);
  EXPECT_DOUBLE_EQ(set.info().texel_pitch_mm, 0.25);
  ASSERT_EQ(set.info().texel_count(), kTexels);
  for (int t = 0; t < kTexels; ++t) {
    const std::vector<float> samples = testing::samples_of(set, t);
    std::size_t i = 0;
    for (int v = 0; v < kViews; ++v)
      for (int l = 0; l < kLights; ++l)
        for (int c = 0; c < 3; ++c) {
          const double expected =
              t == missing ? 0.0 : law(t, v, l, c) * (multiplied ? std::cos(light_theta(l)) : 1.0);
          ASSERT_NEAR(samples[i++], expected, error) << t << " " << v << " " << l << " " << c;
        }
  }
}

class Ubo2014 : public ::testing::Test {
 protected:
  SampleSet set_of(const std::string& bytes) const {
    file_.write(bytes);
    return file_.set();
  }
  testing::ImportedFile file_{"ubo2014", "carpet.btf"};
};

TEST_F(Ubo2014, ReadsWholeFactors) {
  for (const char* signature : {"!FMF06FC", "!FMF06FCR"})
    for (const bool turned : {false, true})
      expect_law(set_of(fmf(common(signature), 4, turned, law)), kRounding);
  expect_law(set_of(fmf(common("!FMF06FC"), 2, false, law)), kHalfFile);
  expect_law(set_of(fmf(common("!FMF06FC"), 8, false, law)), kRounding);
}

TEST_F(Ubo2014, RestoresTheDynamicRange) {
  const std::string head = common("!FMF12FCER");
  expect_law(set_of(fmf(head + extension(0), 4, false, law)), kRounding);
  const auto logarithm = [](int t, int v, int l, int c) {
    return std::log(law(t, v, l, c) + kEpsilon);
  };
  expect_law(set_of(fmf(head + extension(1), 4, false, logarithm)), kRounding);
  file_.write(fmf(head + '\3' + extension(1).substr(1), 4, false, law));
  file_.expect_refused("version 3 of its extension");
}

TEST_F(Ubo2014, KnowsTheCosine) {
  for (const std::uint32_t version : {1U, 2U, 3U, 4U})
    for (const std::uint32_t flag : {0U, 1U})
      expect_law(set_of(fmf(common("!FMF06FC", version, flag), 4, false, law)),
                 kRounding,
                 version == 1 || flag == 0);
  expect_law(set_of(bdi(0, 0)), kRounding, true);
}

TEST_F(Ubo2014, ReadsDecorrelatedFactors) {
  for (const int model : {0, 1, 3, 4, 9, 10, 11, 12}) {
    SCOPED_TRACE(model);
    expect_law(set_of(dfmf(model, 4, false)), kRounding);
  }
  expect_law(set_of(dfmf(11, 8, true)), kRounding);
  expect_law(set_of(dfmf(11, 2, false)), kHalfFile);
  for (const int model : {2, 5, 6, 7, 13, -1}) {
    file_.write(dfmf(model, 4, false));
    file_.expect_refused(model == 2 ? "Lab" : "colour model");
  }
}

TEST_F(Ubo2014, ReadsFactorsOfViews) {
  for (const bool of_texels : {true, false}) expect_law(set_of(pvf(4, of_texels)), kRounding);
  expect_law(set_of(pvf(2, true)), kHalfFile);
}

TEST_F(Ubo2014, ReadsPlainTexels) {
  expect_law(set_of(bdi(0)), kRounding);
  expect_law(set_of(bdi(1)), kRounding);
  expect_law(set_of(bdi(2)), kRounding, false, kMissing);
  file_.write(bdi(3));
  file_.expect_refused("compression 3");
}

TEST_F(Ubo2014, KeepsTheCrop) {
  for (const std::string& bytes : {bdi(1), fmf(common("!FMF06FC"), 4, true, law), pvf(4, false)}) {
    file_.write(bytes);
    const SampleSet set = file_.set({Crop{1, 1, 2, 1}});
    ASSERT_EQ(set.info().texel_count(), 2);
    EXPECT_NEAR(testing::samples_of(set, 1)[3], law(5, 0, 1, 0), kRounding);
  }
  const Status outside = file_.import({Crop{2, 0, 2, 1}});
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, Errc::kInvalidOption);
}

TEST_F(Ubo2014, NegativeValuesAreZeroAndHugeOnesRefused) {
  const SampleSet set =
      set_of(fmf(common("!FMF06FC"), 4, false, [](int, int, int, int) { return -1.0; }));
  EXPECT_EQ(testing::samples_of(set)[0], 0.0F);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity(),
                           1e6}) {
    file_.write(fmf(common("!FMF06FC"), 4, false, [bad](int, int, int, int) { return bad; }));
    file_.expect_refused("not finite");
  }
}

// The bytes of `number` in place of those at `offset`.
template <class Number>
std::string patched(std::string bytes, std::size_t offset, Number number) {
  std::memcpy(&bytes[offset], &number, sizeof number);
  return bytes;
}

TEST_F(Ubo2014, HeadersThatLieAreRefused) {
  const std::string good = fmf(common("!FMF06FC"), 4, false, law);
  const std::size_t views = 8 + meta(4, 1).size();
  const std::size_t size = views + sampling().size();
  const auto refused = [&](std::size_t offset, auto number, const std::string& says) {
    file_.write(patched(good, offset, number));
    file_.expect_refused(says);
  };
  refused(0, 'x', "signature");
  refused(8, std::uint32_t{300}, "header states 300 bytes");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const std::uint32_t count : {0U, 5001U, 0xffffffffU}) {
    refused(views, count, "number of views");
    refused(views + 12, count, "number of lights");
  }
  for (const float theta : {-0.1F, 1.6F, 90.0F, nan, HUGE_VALF})
    refused(views + 4, theta, "does not point up");
  refused(views + 8, nan, "does not point up");
  const std::size_t second = views + 4 + 12 + kLights * 8;
  refused(second, 0.0F, "views 0 and 1 have the same direction");
  refused(second + 8, std::uint32_t{3}, "view 1 has 3 lights");
  refused(views + 16 + 8, 0.0F, "lights 0 and 1 have the same direction");
  refused(size, std::uint32_t{0}, "claims 0 x 2");
  refused(size, 0xffffffffU, "claims");
  refused(size, 0x7fffffffU, "claims");
  refused(size + 4, 0x10000000U, "does not fit");
  refused(size + 12, std::uint8_t{3}, "3 bytes");
  refused(size + 13, std::uint32_t{0}, "no components");
  refused(size + 13, 0xffffffffU, "cut short");
  refused(size + 17, 0x80000000U, "does not fit");
  refused(size + 21, 0x80000000U, "does not fit");
}

std::vector<std::string> one_of_each() {
  return {fmf(common("!FMF06FCR"), 4, false, law),
          fmf(common("!FMF12FCER") + extension(1), 2, true, law),
          dfmf(11, 2, false),
          pvf(2, true),
          pvf(4, false),
          bdi(0),
          bdi(1),
          bdi(2)};
}

TEST_F(Ubo2014, FilesThatEndEarlyAreRefused) {
  for (const std::string& bytes : one_of_each()) file_.expect_cuts_refused(bytes, 7);
}

// Reads all that lies in a file, without writing a set.
bool parses(const std::string& bytes) {
  BinaryReader reader(std::as_bytes(std::span(bytes)), "testing");
  const auto header = ubo2014::read_header(reader);
  if (!header) return false;
  if (header->body != ubo2014::Body::kPlain)
    return ubo2014::read_factors(reader, *header).has_value();
  const auto texels = ubo2014::read_plain(reader, *header);
  if (!texels) return false;
  bool good = true;
  for (const ubo2014::Chunk& chunk : texels->chunks)
    good = unpack(chunk,
                  texels->compressed,
                  static_cast<std::size_t>(header->pair_count()) * 3,
                  [&](std::uint64_t place, std::span<const std::byte>) {
                    EXPECT_LT(place, texels->stored.size());
                  }) &&
           good;
  return good;
}

TEST_F(Ubo2014, EveryCutAndEveryHugeNumberIsSurvived) {
  for (const std::string& bytes : one_of_each()) {
    ASSERT_TRUE(parses(bytes));
    for (std::size_t size = 0; size < bytes.size(); ++size)
      ASSERT_FALSE(parses(bytes.substr(0, size))) << size;
    for (std::size_t offset = 0; offset + 4 <= bytes.size(); ++offset)
      for (const std::uint32_t number : {0U, 0x7fffffffU, 0x80000000U, 0xffffffffU})
        parses(patched(bytes, offset, number));
  }
}

TEST_F(Ubo2014, DamagedBytesAreSurvived) {
  Pcg32 random(3);
  for (const std::string& bytes : one_of_each()) {
    for (int round = 0; round < 1000; ++round) {
      std::string damaged = bytes;
      for (int flip = 0; flip < 3; ++flip)
        damaged[random.next() % damaged.size()] ^= static_cast<char>(1U << (random.next() % 8));
      parses(damaged);
    }
    file_.expect_flips_survived(bytes, bytes.size(), 10);
  }
}

}  // namespace
}  // namespace veneer::btf
