// SPDX-License-Identifier: Apache-2.0
#include "daemon/daemon.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/files.h"
#include "base/image_files.h"
#include "calibration/profile_store.h"
#include "daemon/testing/daemon_fixture.h"
#include "render/internal_testing.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using service::State;

/// Frames a second of the virtual runs.
constexpr int kRate = 50;

class DaemonTest : public testing::DaemonFixture {
 protected:
  /// Runs so many virtual frames; `direct` is asked before each.
  void run(int frames, const std::function<void(int, service::ServiceControl&)>& direct) {
    Devices fakes = devices();
    service::ServiceControl* control = nullptr;
    fakes.before_frame = [&](std::uint64_t number, Time) {
      direct(static_cast<int>(number), *control);
    };
    auto daemon = Daemon::create(at("veneer.toml"),
                                 {"clock=\"virtual\"",
                                  fmt::format("frames={}", frames),
                                  fmt::format("frame_rate_hz={}", kRate)},
                                 std::move(fakes));
    ASSERT_TRUE(daemon) << daemon.error().what;
    control = daemon->get();
    SilentProgress silent;
    const std::atomic<bool> stop{false};
    const Result<Summary> summary = (*daemon)->run(stop, silent);
    ASSERT_TRUE(summary) << summary.error().what;
    EXPECT_EQ(summary->frames, static_cast<std::uint64_t>(frames));
    EXPECT_EQ((*daemon)->status().state, State::kStopping);
    EXPECT_EQ(hand_.alive, 0) << "every renderer was destroyed";
    EXPECT_FALSE((*daemon)->reload()) << "it is over";
  }
  /// A run in which something is wrong from frame kBegin to kEnd: it is among the faults soon, has
  /// the effect that it should, and is over within its stated time.
  void expect_recovery(FaultKind kind,
                       const std::function<void(bool)>& wrong,
                       Duration noticed_within,
                       Duration lasts = 4s) {
    constexpr int kBegin = 20;
    const int end = kBegin + static_cast<int>(to_seconds(lasts) * kRate);
    const int noticed =
        kBegin + 1 + static_cast<int>(std::ceil(to_seconds(noticed_within) * kRate));
    const int over =
        end + 1 + static_cast<int>(std::ceil(to_seconds(service::recovery_time_of(kind)) * kRate));
    ASSERT_LT(noticed, end);
    run(over + 10, [&](int frame, service::ServiceControl& control) {
      if (frame == kBegin) {
        EXPECT_EQ(control.status().state, State::kRunning);
        wrong(true);
      }
      if (frame == end) wrong(false);
      if (frame >= noticed && frame < end) {
        const auto status = control.status();
        ASSERT_EQ(status.faults.size(), 1U) << frame;
        EXPECT_EQ(status.faults[0].kind, kind);
        EXPECT_EQ(status.state, effect_of(kind));
        EXPECT_FALSE(status.faults[0].text.empty());
        if (effect_of(kind) == State::kBlank) {
          EXPECT_TRUE(hand_.dark) << frame;
        }
        if (effect_of(kind) == State::kDegraded) {
          EXPECT_FALSE(hand_.dark) << frame;
        }
      }
      if (frame == over) {
        const auto status = control.status();
        EXPECT_EQ(status.state, State::kRunning);
        EXPECT_TRUE(status.faults.empty());
        EXPECT_EQ(status.recovered, 1U);
        EXPECT_FALSE(hand_.dark);
      }
    });
  }
};

TEST_F(DaemonTest, ATrackerThatIsUnpluggedIsOpenedAgain) {
  expect_recovery(
      FaultKind::kTracker, [this](bool wrong) { hand_.tracker_gone = wrong; }, 100ms);
  EXPECT_EQ(hand_.trackers, 2);
}

TEST_F(DaemonTest, ATrackerThatFallsSilentIsAFaultUntilItSpeaks) {
  expect_recovery(
      FaultKind::kTracker, [this](bool wrong) { hand_.tracker_silent = wrong; }, 1100ms);
  EXPECT_EQ(hand_.trackers, 1);
}

TEST_F(DaemonTest, AnUnpluggedDisplayIsTriedWithEveryFrame) {
  expect_recovery(
      FaultKind::kOutput, [this](bool wrong) { hand_.output_away = wrong; }, 20ms);
  EXPECT_EQ(hand_.outputs, 1);
}

TEST_F(DaemonTest, ABrokenOutputIsOpenedAgain) {
  expect_recovery(
      FaultKind::kOutput,
      [this](bool wrong) {
        hand_.output_broken = wrong;
        hand_.output_refuses = wrong;
      },
      20ms);
  EXPECT_EQ(hand_.outputs, 2);
}

TEST_F(DaemonTest, ALostGpuIsDarkUntilThereIsAnotherRenderer) {
  expect_recovery(
      FaultKind::kGpu,
      [this](bool wrong) {
        hand_.gpu_lost = wrong;
        hand_.renderer_refuses = wrong;
      },
      20ms);
  EXPECT_EQ(hand_.renderers, 2);
  EXPECT_GT(hand_.blanks, 0);
}

TEST_F(DaemonTest, ScarceMemoryIsAFault) {
  expect_recovery(
      FaultKind::kMemory, [this](bool wrong) { pressure_ = wrong ? 0.5 : 0.01; }, 2s);
}

TEST_F(DaemonTest, ALostGpuWithoutAnyOtherTroubleTakesOneFrame) {
  run(30, [&](int frame, service::ServiceControl& control) {
    if (frame == 10) hand_.gpu_lost = true;
    if (frame == 11) {
      EXPECT_TRUE(hand_.dark);
      EXPECT_EQ(control.status().state, State::kBlank);
    }
    if (frame >= 13) {
      EXPECT_EQ(control.status().state, State::kRunning) << frame;
    }
  });
  EXPECT_EQ(hand_.renderers, 2);
}

TEST_F(DaemonTest, BlankIsDarkAndComesBackWithinAFrame) {
  run(40, [&](int frame, service::ServiceControl& control) {
    if (frame == 10) {
      EXPECT_TRUE(control.blank(true));
    }
    if (frame > 10 && frame <= 20) {
      EXPECT_TRUE(hand_.dark) << frame;
      EXPECT_EQ(control.status().state, State::kBlank);
      EXPECT_EQ(control.frames(), static_cast<std::uint64_t>(frame)) << "dark frames are frames";
    }
    if (frame == 20) {
      EXPECT_TRUE(control.blank(false));
    }
    if (frame > 20) {
      EXPECT_FALSE(hand_.dark) << frame;
    }
  });
  EXPECT_EQ(hand_.blanks, 1);
  EXPECT_EQ(hand_.presented, 30U);
}

TEST_F(DaemonTest, WhatACallRefusesChangesNothing) {
  run(20, [&](int frame, service::ServiceControl& control) {
    if (frame != 10) return;
    EXPECT_EQ(control.load_material(at("nothing")).error().code, Errc::kNotFound);
    EXPECT_FALSE(control.load_material(at("scene.toml")));
    EXPECT_EQ(control.set_scene(at("nothing")).error().code, Errc::kNotFound);
    EXPECT_EQ(control.set_light(1, {}).error().code, Errc::kInvalidOption);
    EXPECT_EQ(control.set_light(-1, {}).error().code, Errc::kInvalidOption);
    EXPECT_EQ(control.set_light(0, {{0, 0, 0}, 1, {1, 1, 1}}).error().code, Errc::kInvalidOption);
    hand_.renderer_refuses = true;
    EXPECT_EQ(control.load_material(at("material.safetensors")).error().code, Errc::kUnavailable);
    hand_.renderer_refuses = false;
    EXPECT_EQ(control.status().state, State::kRunning);
    EXPECT_TRUE(control.status().faults.empty());
  });
  EXPECT_EQ(hand_.renderers, 1);
  EXPECT_EQ(hand_.presented, 20U);
}

TEST_F(DaemonTest, ALightThatIsSetStaysUntilAReload) {
  run(30, [&](int frame, service::ServiceControl& control) {
    if (frame == 10) {
      EXPECT_TRUE(control.set_light(0, {{0, 0, 2}, 120, {1, 1, 1}}));
      EXPECT_EQ(lux_, 120);
      EXPECT_TRUE(control.load_material(at("material.safetensors")));
      EXPECT_EQ(lux_, 120) << "another call leaves it";
    }
    if (frame == 20) {
      EXPECT_TRUE(control.reload());
      EXPECT_EQ(lux_, 300);
    }
  });
  EXPECT_EQ(hand_.presented, 30U) << "no frame was lost";
}

TEST_F(DaemonTest, AReloadTakesWhatTheFilesSay) {
  run(30, [&](int frame, service::ServiceControl& control) {
    if (frame == 10) {
      write_scene("50");
      write_config("[render]\nluminance_ceiling = 80\n");
      EXPECT_TRUE(control.reload());
    }
    if (frame > 10) {
      EXPECT_EQ(control.status().luminance_ceiling, 80);
    }
    if (frame > 11) {
      EXPECT_EQ(hand_.ceiling, 80);
    }
  });
  EXPECT_EQ(lux_, 50);
}

TEST_F(DaemonTest, ABadFileIsRefusedAndIsOverOnceItIsGood) {
  struct Case {
    FaultKind kind;
    std::function<void()> spoil;
    std::function<void()> mend;
  };
  const std::string material = read_text(at("material.safetensors")).value();
  const std::vector<Case> cases{
      {FaultKind::kConfiguration,
       [] { write_config("framerate = 60\n"); },
       [] { write_config(""); }},
      {FaultKind::kConfiguration, [] { write_config("[[["); }, [] { write_config(""); }},
      {FaultKind::kScene, [] { write_scene("\"bright\""); }, [] { write_scene("300"); }},
      {FaultKind::kMaterial,
       [] { ASSERT_TRUE(write_text(at("material.safetensors"), "rubbish")); },
       [&] { ASSERT_TRUE(write_text(at("material.safetensors"), material)); }},
      {FaultKind::kProfile,
       [] { std::filesystem::rename(at("profile"), at("away")); },
       [] { std::filesystem::rename(at("away"), at("profile")); }},
  };
  for (const Case& trouble : cases) {
    SCOPED_TRACE(name_of(trouble.kind));
    run(800, [&](int frame, service::ServiceControl& control) {
      if (frame == 10) {
        trouble.spoil();
        EXPECT_FALSE(control.reload());
      }
      if (frame == 11 || frame == 200) {
        const auto status = control.status();
        ASSERT_EQ(status.faults.size(), 1U);
        EXPECT_EQ(status.faults[0].kind, trouble.kind) << status.faults[0].text;
        EXPECT_EQ(status.state, State::kDegraded);
        EXPECT_FALSE(hand_.dark);
      }
      if (frame == 200) {
        trouble.mend();
        if (trouble.kind == FaultKind::kProfile) {
          EXPECT_TRUE(control.reload()) << "in virtual time nobody watches it";
        }
      }
      if (frame == 201 + 10 * kRate) {
        EXPECT_EQ(control.status().state, State::kRunning);
      }
    });
  }
}

TEST_F(DaemonTest, GoodFilesAreTriedAgainUntilARendererCanBeMadeOfThem) {
  const auto over =
      static_cast<int>(to_seconds(service::recovery_time_of(FaultKind::kConfiguration)) * kRate);
  run(202 + over, [&](int frame, service::ServiceControl& control) {
    if (frame == 10) {
      write_scene("50");
      hand_.renderer_refuses = true;
      EXPECT_EQ(control.reload().error().code, Errc::kUnavailable);
    }
    if (frame == 11 || frame == 200) {
      const auto status = control.status();
      ASSERT_EQ(status.faults.size(), 1U);
      EXPECT_EQ(status.faults[0].kind, FaultKind::kConfiguration);
      EXPECT_EQ(status.state, State::kDegraded);
      EXPECT_FALSE(hand_.dark) << "the picture of before stays";
      EXPECT_EQ(lux_, 300);
    }
    // No file changes, and nobody asks.
    if (frame == 200) hand_.renderer_refuses = false;
    if (frame == 201 + over) {
      EXPECT_EQ(control.status().state, State::kRunning);
      EXPECT_EQ(lux_, 50);
    }
  });
  EXPECT_EQ(hand_.presented, static_cast<std::uint64_t>(202 + over)) << "no frame was lost";
}

TEST_F(DaemonTest, AConfigurationThatIsGoodAgainIsNoFaultHoweverTheProfileIs) {
  run(20, [&](int frame, service::ServiceControl& control) {
    if (frame != 10) return;
    // The same file comes back, so that nothing but the profile is read.
    std::filesystem::rename(at("veneer.toml"), at("good.toml"));
    write_config("[[[");
    EXPECT_FALSE(control.reload());
    std::filesystem::rename(at("good.toml"), at("veneer.toml"));
    std::filesystem::rename(at("profile"), at("away"));
    EXPECT_FALSE(control.reload());
    std::filesystem::rename(at("away"), at("profile"));
    const auto faults = control.status().faults;
    ASSERT_EQ(faults.size(), 1U);
    EXPECT_EQ(faults[0].kind, FaultKind::kProfile);
  });
}

TEST_F(DaemonTest, ASnapshotHasTheCodesOfTheFrame) {
  run(20, [&](int frame, service::ServiceControl& control) {
    if (frame != 10) return;
    const auto path = control.snapshot();
    ASSERT_TRUE(path) << path.error().what;
    const Image<Rgb8> picture = read_png(*path).value();
    EXPECT_EQ(picture.width(), 8);
    EXPECT_EQ(picture.height(), 6);
    EXPECT_EQ(picture(0, 0), (Rgb8{7, 8, 9}));
  });
}

TEST_F(DaemonTest, ADiskThatTakesNothingIsAFaultUntilItDoes) {
  std::filesystem::remove_all(at("state"));
  ASSERT_TRUE(write_text(at("state"), "a file where a folder should be"));
  const int over =
      50 + static_cast<int>(to_seconds(service::recovery_time_of(FaultKind::kDisk)) * kRate);
  run(over + 1, [&](int frame, service::ServiceControl& control) {
    if (frame == 10) {
      EXPECT_EQ(control.snapshot().error().code, Errc::kIo);
    }
    if (frame == 49) {
      EXPECT_EQ(control.status().state, State::kDegraded);
      std::filesystem::remove(at("state"));
    }
    if (frame == over) {
      EXPECT_EQ(control.status().state, State::kRunning);
    }
  });
  EXPECT_EQ(hand_.presented, static_cast<std::uint64_t>(over + 1));
}

TEST_F(DaemonTest, ManyTroublesAtOnceEndAll) {
  run(1000, [&](int frame, service::ServiceControl& control) {
    hand_.tracker_gone = frame >= 50 && frame < 300;
    hand_.gpu_lost = frame >= 60 && frame < 320;
    hand_.renderer_refuses = hand_.gpu_lost.load();
    hand_.output_broken = frame >= 70 && frame < 450;
    hand_.output_refuses = hand_.output_broken.load();
    if (frame == 250) {
      EXPECT_EQ(control.status().state, State::kBlank) << "a display that is dark is not tried";
      EXPECT_EQ(control.status().faults.size(), 2U);
    }
    if (frame == 440) {
      EXPECT_EQ(control.status().state, State::kFault);
    }
    if (frame == 700) {
      EXPECT_EQ(control.status().state, State::kRunning);
    }
  });
}

}  // namespace
}  // namespace veneer::daemon
