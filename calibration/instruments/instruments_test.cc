// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/instruments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "calibration/exchange/cgats.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

class AnyDisplay final : public PatchDisplay {
 public:
  Status show(const Rgb16& /*code*/, bool /*lit*/) override { return {}; }
  Status show_picture(ImageView<const Rgb16> /*codes*/) override { return {}; }
};

class Instruments : public ::testing::Test {
 protected:
  Result<std::unique_ptr<Colorimeter>> open(const std::string& table) {
    VENEER_ASSIGN(TomlReader toml, TomlReader::parse(table, "test"));
    VENEER_ASSIGN(auto instrument, open_instrument(toml, services_));
    VENEER_TRY(toml.finish());
    return instrument;
  }
  Error refusal(const std::string& table) {
    const auto instrument = open(table);
    EXPECT_FALSE(instrument) << table;
    return instrument ? Error{} : instrument.error();
  }
  SteadyClock clock_;
  InstrumentServices services_{clock_, {}, nullptr, nullptr};
};

TEST_F(Instruments, AreSortedAndDescribed) {
  std::string_view before;
  for (const InstrumentDriver& driver : instrument_drivers()) {
    EXPECT_LT(before, driver.name);
    EXPECT_FALSE(driver.summary.empty());
    before = driver.name;
  }
}

TEST_F(Instruments, AnUnknownOneIsRefusedWithThoseThereAre) {
  const Error error = refusal("driver = \"i1pro\"");
  EXPECT_EQ(error.code, Errc::kInvalidOption);
  EXPECT_THAT(error.what, HasSubstr("\"colorhug\" \"file\" \"spotread\""));
}

TEST_F(Instruments, AFilePlaysBackWhatTheDisplayShows) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "x.ti3";
  ASSERT_TRUE(write_ti3(path, {"meter", {{{0, 0, 0}, {1, 1, 1}}, {{1, 1, 1}, {90, 100, 80}}}}));
  AnyDisplay display;
  WatchedDisplay watched(display, 10);
  services_.display = &watched;
  const auto instrument = open("driver = \"file\"\nwhite_reference = \"" + path.string() + "\"");
  ASSERT_TRUE(instrument) << instrument.error().what;
  ASSERT_TRUE(watched.show({1023, 1023, 1023}));
  EXPECT_EQ((*instrument)->read(Target::kWhiteReference, {}).value(), Xyz(90, 100, 80));
}

TEST_F(Instruments, WhatOneNeedsAndIsNotThereIsSaid) {
  EXPECT_THAT(refusal("driver = \"file\"").what, HasSubstr("white_reference"));
  EXPECT_EQ(refusal("driver = \"file\"\nwhite_reference = \"x\"").code, Errc::kUnavailable);
  EXPECT_EQ(refusal("driver = \"camera\"\nspot = [1, 2]\n"
                    "xyz_from_rate = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]")
                .code,
            Errc::kUnavailable);
}

TEST_F(Instruments, OptionsAreReadAndMisspeltOnesRefusedBeforeAnythingIsOpened) {
  EXPECT_EQ(refusal("driver = \"spotread\"\nprogramm = \"x\"").code, Errc::kInvalidOption);
  EXPECT_EQ(refusal("driver = \"spotread\"\nstart_limit_s = 0").code, Errc::kInvalidOption);
  EXPECT_EQ(refusal("driver = \"spotread\"\nreading_limit_s = nan").code, Errc::kInvalidOption);
  EXPECT_EQ(refusal("driver = \"colorhug\"\ncalibration = 99").code, Errc::kInvalidOption);
  EXPECT_EQ(refusal("driver = \"colorhug\"\ncorrection = \"/nonexistent.ccmx\"").code,
            Errc::kNotFound);
  EXPECT_EQ(refusal("driver = \"spotread\"\nprogram = \"/nonexistent/spotread\"").code,
            Errc::kNotFound);
}

}  // namespace
}  // namespace veneer::calibration
