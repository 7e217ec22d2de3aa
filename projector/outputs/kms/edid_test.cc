// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/edid.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "projector/outputs/kms/fake_kms_device.h"

namespace veneer::projector {
namespace {

TEST(Edid, GivesBackTheTextsThatItWasMadeOf) {
  for (const char* name : {"A", "EPSON PJ", "thirteen char"}) {
    const EdidIdentity identity = read_edid(fake_edid(name, "X3W4"));
    EXPECT_EQ(identity.name, name);
    EXPECT_EQ(identity.serial, "X3W4");
    EXPECT_EQ(identity.maker, "SEC");
  }
}

TEST(Edid, TakesTheSerialNumberWhereThereIsNoText) {
  EXPECT_EQ(read_edid(fake_edid("A", "", 0xfedcba98)).serial, "4275878552");
  EXPECT_EQ(read_edid(fake_edid("A", "text", 7)).serial, "text");
  EXPECT_EQ(read_edid(fake_edid("A", "", 0)).serial, "");
}

TEST(Edid, IsEmptyForWhatIsNone) {
  const std::string whole = fake_edid("EPSON", "1");
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_EQ(read_edid(whole.substr(0, size)).name, "") << size;
  EXPECT_EQ(read_edid(std::string(128, '\0')).maker, "");
}

TEST(Edid, LetsNoControlCharacterThrough) {
  Pcg32 random(1);
  for (int run = 0; run < 1000; ++run) {
    std::string edid = fake_edid("EPSON", "1");
    for (std::size_t i = 8; i < edid.size(); ++i) {
      if (random.next() % 4 == 0) edid[i] = static_cast<char>(random.next());
    }
    const EdidIdentity identity = read_edid(edid);
    for (const std::string& text : {identity.maker, identity.name, identity.serial}) {
      EXPECT_LE(text.size(), 13U);
      for (const char c : text) EXPECT_TRUE(c >= 0x20 && c < 0x7f) << run << ": " << int{c};
    }
  }
}

}  // namespace
}  // namespace veneer::projector
