// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/cgats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::calibration {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

/// What ten significant digits keep of a value.
constexpr double kTenDigits = 1e-9;

std::filesystem::path colour_data() {
  const char* const data = std::getenv("VENEER_DATA");
  return std::filesystem::path(data != nullptr ? data : "../shared/data") / "colour";
}

/// A .ti3 of these rows, with `lines` among its properties.
std::string ti3(const std::string& rows, int sets, const std::string& lines = "") {
  return fmt::format(
      "CTI3\n\nDESCRIPTOR \"test\"\nDEVICE_CLASS \"DISPLAY\"\nCOLOR_REP \"RGB_XYZ\"\n{}\n"
      "NUMBER_OF_FIELDS 7\nBEGIN_DATA_FORMAT\n"
      "SAMPLE_ID RGB_R RGB_G RGB_B XYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\n"
      "NUMBER_OF_SETS {}\nBEGIN_DATA\n{}END_DATA\n",
      lines,
      sets,
      rows);
}

const std::string kTwoRows = "1 0 0 0 0.1 0.2 0.3\n2 100 50 25 90 100 80\n";

std::string refusal(const std::string& text) {
  const auto read = parse_ti3(text, "x.ti3");
  if (read) return "it was read";
  EXPECT_EQ(read.error().code, Errc::kBadFormat);
  EXPECT_THAT(read.error().what, HasSubstr("reading x.ti3"));
  return read.error().what;
}

TEST(Ti3, BothScalesOfRgbAreTheSameDrives) {
  const auto percent = parse_ti3(ti3(kTwoRows, 2), "percent");
  const auto unit = parse_ti3(ti3("1 0 0 0 0.1 0.2 0.3\n2 1 0.5 0.25 90 100 80\n", 2), "unit");
  ASSERT_TRUE(percent) << percent.error().what;
  ASSERT_TRUE(unit) << unit.error().what;
  ASSERT_EQ(percent->patches.size(), 2U);
  ASSERT_EQ(unit->patches.size(), 2U);
  EXPECT_EQ(percent->patches[1].drive, Eigen::Vector3d(1, 0.5, 0.25));
  EXPECT_EQ(unit->patches[1].drive, percent->patches[1].drive);
  EXPECT_EQ(unit->patches[1].xyz, Xyz(90, 100, 80));
}

TEST(Ti3, NormalisedValuesComeBackInNits) {
  const auto read = parse_ti3(
      ti3(kTwoRows, 2, "LUMINANCE_XYZ_CDM2 \"45 50 40\"\nNORMALIZED_TO_Y_100 \"YES\"\n"), "x");
  ASSERT_TRUE(read) << read.error().what;
  EXPECT_TRUE(read->patches[1].xyz.isApprox(Xyz(45, 50, 40), kTenDigits));
}

TEST(Ti3, WhatIsWrittenIsReadAgain) {
  MeasuredPatches measured{"A \"quoted\" instrument", {}};
  Pcg32 random(11);
  for (int i = 0; i < 200; ++i) {
    const auto uniform = [&] { return random.uniform(); };
    measured.patches.push_back(
        {{uniform(), uniform(), uniform()}, {300 * uniform(), 300 * uniform(), -0.01 * uniform()}});
  }
  measured.patches.push_back({Eigen::Vector3d::Ones(), {95, 100, 108}});
  const TemporaryFolder folder;
  const auto path = folder.path() / "x.ti3";
  ASSERT_TRUE(write_ti3(path, measured));
  const auto read = read_ti3(path);
  ASSERT_TRUE(read) << read.error().what;
  EXPECT_EQ(read->instrument, "A 'quoted' instrument");
  ASSERT_EQ(read->patches.size(), measured.patches.size());
  for (std::size_t i = 0; i < read->patches.size(); ++i) {
    const PatchReading& was = measured.patches[i];
    EXPECT_LT((read->patches[i].drive - was.drive).norm(), kTenDigits) << i;
    EXPECT_LT((read->patches[i].xyz - was.xyz).norm(), kTenDigits * 300) << i;
  }
}

TEST(Ti3, WhatMakesNoTableIsNotWritten) {
  const double nan = std::nan("");
  EXPECT_FALSE(ti3_text({}));
  EXPECT_FALSE(ti3_text({"", {{{0, 0, nan}, {1, 1, 1}}}}));
  EXPECT_FALSE(ti3_text({"", {{{0, 0, 1.01}, {1, 1, 1}}}}));
  EXPECT_FALSE(ti3_text({"", {{{0, -0.01, 1}, {1, 1, 1}}}}));
  EXPECT_FALSE(ti3_text({"", {{{0, 0, 0.01}, {1, 1, 1}}}}));  // 1 percent, or all of it?
  EXPECT_TRUE(ti3_text({"", {{{0, 0, 0}, {1, 1, 1}}}}));
  EXPECT_FALSE(ti3_text({"", {{{0, 0, 1}, {1, std::numeric_limits<double>::infinity(), 1}}}}));
}

TEST(Ti3, WhatIsNoTableOfReadingsIsRefusedWithItsReason) {
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  EXPECT_THAT(refusal(std::string("CTI3\n\0 ", 7)), HasSubstr("zero bytes"));
  EXPECT_THAT(refusal("CTI3\n.INCLUDE \"/dev/zero\"\n"), HasSubstr("includes another file"));
  EXPECT_THAT(refusal(std::string(kLargestCgats + 1, ' ')), HasSubstr("bytes"));
  EXPECT_THAT(refusal("\xFF\xFE\x80 binary \x01"), HasSubstr("CGATS"));
  EXPECT_THAT(refusal("CTI1" + ti3(kTwoRows, 2).substr(4)), HasSubstr("not CTI3"));
  std::string printer = ti3(kTwoRows, 2);
  printer.replace(printer.find("DISPLAY"), 7, "OUTPUT");
  EXPECT_THAT(refusal(printer), HasSubstr("OUTPUT"));
  std::string spectral = ti3(kTwoRows, 2);
  spectral.replace(spectral.find("XYZ_X"), 5, "LAB_L");
  EXPECT_THAT(refusal(spectral), HasSubstr("no column XYZ_X"));
}

TEST(Ti3, CountsThatLieAreRefusedBeforeAnythingIsAllocated) {
  EXPECT_THAT(refusal(ti3(kTwoRows, 1000000000)), HasSubstr("NUMBER_OF_SETS"));
  EXPECT_THAT(refusal(ti3(kTwoRows, 20000)), HasSubstr("broken off"));
  EXPECT_THAT(refusal(ti3(kTwoRows, -1)), HasSubstr("NUMBER_OF_SETS"));
  EXPECT_THAT(refusal(ti3(kTwoRows, 0)), HasSubstr("0 patches"));
  std::string fields = ti3(kTwoRows, 2);
  fields.replace(fields.find("FIELDS 7"), 8, "FIELDS 999999999");
  EXPECT_THAT(refusal(fields), HasSubstr("NUMBER_OF_FIELDS"));
  // Fewer and more rows than are there.
  EXPECT_NE(refusal(ti3(kTwoRows, 3)), "it was read");
  EXPECT_NE(refusal(ti3(kTwoRows, 1)), "it was read");
}

TEST(Ti3, EveryTruncationIsRefused) {
  const std::string whole = ti3(kTwoRows, 2);
  const std::size_t end = whole.find("END_DATA\n", whole.find("BEGIN_DATA\n"));
  for (std::size_t size = 0; size < end; ++size)
    EXPECT_FALSE(parse_ti3(whole.substr(0, size), "x")) << whole.substr(0, size);
}

TEST(Ti3, ValuesThatAreNoneAreRefused) {
  EXPECT_THAT(refusal(ti3("1 0 0 0 nan 0.2 0.3\n2 1 1 1 9 9 9\n", 2)), HasSubstr("\"nan\""));
  EXPECT_THAT(refusal(ti3("1 0 0 0 inf 0.2 0.3\n2 1 1 1 9 9 9\n", 2)), HasSubstr("\"inf\""));
  EXPECT_NE(refusal(ti3("1 0 0 0 1e999 0.2 0.3\n2 1 1 1 9 9 9\n", 2)), "it was read");
  EXPECT_THAT(refusal(ti3("1 0 0 0 1 0.2 0.3\n2 1 x 1 9 9 9\n", 2)), HasSubstr("RGB_G"));
  EXPECT_THAT(refusal(ti3("1 0 0 0 1 0.2 0.3\n2 1 101 1 9 9 9\n", 2)), HasSubstr("0 to 100"));
  EXPECT_THAT(refusal(ti3("1 0 0 0 1 0.2 0.3\n2 1 -1 1 9 9 9\n", 2)), HasSubstr("0 to 100"));
  EXPECT_THAT(refusal(ti3("1 0 0 0 1 0.2 0.3\n1 1 1 1 9 9 9\n", 2)), HasSubstr("twice"));
}

TEST(Ti3, ValuesWhoseUnitIsNotSaidAreRefused) {
  EXPECT_THAT(refusal(ti3(kTwoRows, 2, "NORMALIZED_TO_Y_100 \"YES\"\n")),
              HasSubstr("how bright white is"));
  EXPECT_THAT(
      refusal(ti3(kTwoRows, 2, "LUMINANCE_XYZ_CDM2 \"1 nan 1\"\nNORMALIZED_TO_Y_100 \"YES\"\n")),
      HasSubstr("how bright white is"));
  EXPECT_THAT(refusal(ti3(kTwoRows, 2, "NORMALIZED_TO_Y_100 \"PERHAPS\"\n")), HasSubstr("PERHAPS"));
  EXPECT_THAT(refusal(ti3(kTwoRows, 2, "LUMINANCE_XYZ_CDM2 \"1 1 1\"\n")),
              HasSubstr("NORMALIZED_TO_Y_100"));
}

TEST(Ti3, BytesThatAreNoUtf8DoNotReachTexts) {
  const auto read = parse_ti3(ti3(kTwoRows, 2, "TARGET_INSTRUMENT \"M\xFC\x80nki\"\n"), "x");
  ASSERT_TRUE(read) << read.error().what;
  EXPECT_EQ(read->instrument, "M??nki");
}

TEST(Ti3, AFileThatIsNotThereIsSaidSo) {
  const auto read = read_ti3("/nonexistent/x.ti3");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, Errc::kNotFound);
}

TEST(Ti3, RealReadingsOfBothScales) {
  if (!std::filesystem::exists(colour_data()))
    GTEST_SKIP() << "real data absent: " << colour_data();
  // Drives 0..1, a ColorHug; 0..1 written as 1.00, a ColorMunki; normalised, 0..100.
  const auto measured = read_ti3(colour_data() / "measured.ti3");
  const auto reference = read_ti3(colour_data() / "reference.ti3");
  const auto normalised = read_ti3(colour_data() / "normalised.ti3");
  ASSERT_TRUE(measured) << measured.error().what;
  ASSERT_TRUE(reference) << reference.error().what;
  ASSERT_TRUE(normalised) << normalised.error().what;
  ASSERT_EQ(measured->patches.size(), 15U);
  ASSERT_EQ(reference->patches.size(), 15U);
  EXPECT_EQ(measured->instrument, "Hughski ColorHug");
  for (std::size_t i = 0; i < 15; ++i)
    EXPECT_EQ(measured->patches[i].drive, reference->patches[i].drive) << i;
  EXPECT_EQ(measured->patches[1].xyz, Xyz(35.70556641, 40.23742676, 53.87878418));
  ASSERT_EQ(normalised->patches.size(), 2U);
  EXPECT_EQ(normalised->patches[1].drive, Eigen::Vector3d::Ones());
  EXPECT_NEAR(normalised->patches[1].xyz.y(), 99.88938053 * 41.267395 / 100, kTenDigits * 100);
}

TEST(Ti1, RealChartsAreRead) {
  if (!std::filesystem::exists(colour_data()))
    GTEST_SKIP() << "real data absent: " << colour_data();
  const std::vector<std::pair<std::string, std::size_t>> charts{
      {"verify.ti1", 26}, {"ISO_14861_color_accuracy_RGB318.ti1", 318}};
  for (const auto& [name, count] : charts) {
    const auto drives = read_ti1(colour_data() / name);
    ASSERT_TRUE(drives) << drives.error().what;
    EXPECT_EQ(drives->size(), count) << name;
    for (const Eigen::Vector3d& drive : *drives)
      EXPECT_TRUE(drive.minCoeff() >= 0 && drive.maxCoeff() <= 1) << drive.transpose();
  }
}

TEST(Ti1, AMeasurementIsNoChart) { EXPECT_FALSE(parse_ti1(ti3(kTwoRows, 2), "x")); }

std::string ccmx(const std::string& rows) {
  return "CCMX\n\nINSTRUMENT \"I\"\nDISPLAY \"D\"\nCOLOR_REP \"XYZ\"\nNUMBER_OF_FIELDS 3\n"
         "BEGIN_DATA_FORMAT\nXYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\nNUMBER_OF_SETS 3\nBEGIN_DATA\n" +
         rows + "END_DATA\n";
}

TEST(Ccmx, RowsOfTheFileAreRowsOfTheMatrix) {
  const auto read = parse_ccmx(ccmx("1 2 3\n0 5 6\n0 0 9\n"), "x");
  ASSERT_TRUE(read) << read.error().what;
  Eigen::Matrix3d expected;
  expected << 1, 2, 3, 0, 5, 6, 0, 0, 9;
  EXPECT_EQ(read->corrected_from_read, expected);
  EXPECT_EQ(read->instrument, "I");
  EXPECT_EQ(read->display, "D");
}

TEST(Ccmx, WhatCannotBeInvertedIsRefused) {
  EXPECT_FALSE(parse_ccmx(ccmx("1 2 3\n2 4 6\n0 0 9\n"), "x"));
  EXPECT_FALSE(parse_ccmx(ccmx("0 0 0\n0 0 0\n0 0 0\n"), "x"));
  EXPECT_FALSE(parse_ccmx(ccmx("1 2 nan\n0 5 6\n0 0 9\n"), "x"));
  EXPECT_FALSE(parse_ccmx(ccmx("1 2\n0 5 6\n0 0 9\n"), "x"));
  EXPECT_FALSE(parse_ccmx(ccmx("1e200 0 0\n0 1e200 0\n0 0 1e200\n"), "x"));
}

TEST(Ccmx, ARealOneIsRead) {
  if (!std::filesystem::exists(colour_data()))
    GTEST_SKIP() << "real data absent: " << colour_data();
  const auto read = read_ccmx(colour_data() / "calibration.ccmx");
  ASSERT_TRUE(read) << read.error().what;
  EXPECT_EQ(read->corrected_from_read(0, 2), 0.89224);
  EXPECT_EQ(read->corrected_from_read(2, 0), -0.66611);
}

}  // namespace
}  // namespace veneer::calibration
