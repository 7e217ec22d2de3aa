// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/importer.h"

#include <gtest/gtest.h>

#include <limits>

#include "btf/importers/crop.h"

namespace veneer::btf {
namespace {

TEST(Importers, AreFoundByName) {
  ASSERT_FALSE(importers().empty());
  for (const Importer& importer : importers()) {
    const auto found = find_importer(importer.name);
    ASSERT_TRUE(found);
    EXPECT_EQ((*found)->run, importer.run);
  }
}

TEST(Importers, UnknownNameListsThoseThereAre) {
  const auto found = find_importer("rtj");
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, Errc::kInvalidOption);
  for (const Importer& importer : importers())
    EXPECT_NE(found.error().what.find(importer.name), std::string::npos);
}

TEST(Crop, IsTheWholeWhereNoneIsAsked) {
  const auto crop = crop_of({}, 7, 5, "testing");
  ASSERT_TRUE(crop);
  EXPECT_EQ(crop->x, 0);
  EXPECT_EQ(crop->width, 7);
  EXPECT_EQ(crop->height, 5);
}

TEST(Crop, MustLieInside) {
  constexpr int kMost = std::numeric_limits<int>::max();
  for (const Crop& good : {Crop{0, 0, 7, 5}, Crop{6, 4, 1, 1}, Crop{2, 1, 5, 4}})
    EXPECT_TRUE(crop_of({good}, 7, 5, "testing"));
  for (const Crop& bad : {Crop{-1, 0, 2, 2},
                          Crop{0, -1, 2, 2},
                          Crop{0, 0, 0, 1},
                          Crop{0, 0, 1, -1},
                          Crop{7, 0, 1, 1},
                          Crop{1, 0, 7, 5},
                          Crop{1, 0, kMost, 1},
                          Crop{kMost, kMost, kMost, kMost}}) {
    const auto crop = crop_of({bad}, 7, 5, "testing");
    ASSERT_FALSE(crop);
    EXPECT_EQ(crop.error().code, Errc::kInvalidOption);
    EXPECT_NE(crop.error().what.find("7 x 5"), std::string::npos);
  }
}

}  // namespace
}  // namespace veneer::btf
