// SPDX-License-Identifier: Apache-2.0
#include "daemon/daemon.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <future>
#include <thread>

#include "base/files.h"
#include "base/image_files.h"
#include "base/testing/temporary_folder.h"
#include "btf/models/internal_test_models.h"
#include "calibration/profile_store.h"
#include "daemon/testing/fakes.h"
#include "render/internal_testing.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using service::State;
using testing::FakeOutput;
using testing::FakeRenderer;
using testing::MovingTracker;
using testing::Stagehand;

/// Frames a second of the virtual runs.
constexpr int kRate = 50;

class DaemonTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const btf::SampleSet set = btf::testing::dichromatic_set(at("set.btfset"), false);
    const auto material = btf::testing::fit("phong", set, {});
    ASSERT_TRUE(material) << material.error().what;
    ASSERT_TRUE(btf::save_material(**material, at("material.safetensors"), {}));
    ASSERT_TRUE(calibration::ProfileStore(at("profile")).publish(render::example_profile(8, 6, 8)));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::filesystem::path at(const std::string& name) { return folder_->path() / name; }

  void SetUp() override {
    write_scene("300");
    write_config("");
  }
  static void write_scene(const std::string& lux) {
    ASSERT_TRUE(write_text(at("scene.toml"),
                           "mesh = \"sphere\"\n[observer]\ntracker_body = 0\n[[light]]\nkind = "
                           "\"directional\"\ndirection = [0, 0, 1]\nilluminance_lux = " +
                               lux + "\n"));
  }
  static void write_config(const std::string& more) {
    ASSERT_TRUE(write_text(at("veneer.toml"),
                           "scene = \"scene.toml\"\nmaterial = \"material.safetensors\"\nprofile = "
                           "\"profile\"\nstate_directory = \"state\"\nfirst_pose_timeout_s = 2\n" +
                               more));
  }

  Devices devices() {
    Devices devices;
    devices.open_tracker = [this](Clock& clock) -> Result<std::unique_ptr<tracking::Tracker>> {
      if (hand_.tracker_refuses || hand_.tracker_gone)
        return fail(Errc::kNotFound, "there is no tracker");
      ++hand_.trackers;
      return std::make_unique<MovingTracker>(clock, clock.now() + 1ms, Time::max(), &hand_);
    };
    devices.open_output = [this]() -> Result<std::unique_ptr<projector::Output>> {
      if (hand_.output_refuses) return fail(Errc::kNotFound, "there is no display");
      ++hand_.outputs;
      return std::make_unique<FakeOutput>(hand_);
    };
    devices.make_renderer = [this](const render::Scene& scene,
                                   const btf::Material&,
                                   const calibration::ProjectorProfile&,
                                   const render::RendererOptions& options,
                                   const Scanout*) -> Result<std::unique_ptr<render::Renderer>> {
      if (hand_.renderer_refuses) return fail(Errc::kUnavailable, "there is no GPU");
      ++hand_.renderers;
      lux_ = std::get<render::DirectionalLight>(scene.lights.at(0)).illuminance_rgb.x();
      return std::make_unique<FakeRenderer>(hand_, static_cast<int>(options.luminance_ceiling));
    };
    devices.memory_pressure = [this]() -> Result<double> { return pressure_.load(); };
    return devices;
  }

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

  static inline TemporaryFolder* folder_ = nullptr;
  Stagehand hand_;
  std::atomic<double> lux_{0};
  std::atomic<double> pressure_{0};
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

// --- in real time

/// Waits until `done`; false if that takes half a minute.
bool wait_until(const std::function<bool()>& done) {
  for (int i = 0; i < 6000 && !done(); ++i) std::this_thread::sleep_for(5ms);
  return done();
}

class RealTimeDaemonTest : public DaemonTest {
 protected:
  void start() {
    auto daemon = Daemon::create(at("veneer.toml"), {"frame_rate_hz=200"}, devices());
    ASSERT_TRUE(daemon) << daemon.error().what;
    daemon_ = *std::move(daemon);
    ran_ = std::async(std::launch::async, [this] {
      SilentProgress silent;
      return daemon_->run(stop_, silent);
    });
    ASSERT_TRUE(wait_until([&] { return daemon_->frames() > 10; }));
  }
  void end() {
    stop_ = true;
    const Result<Summary> summary = ran_.get();
    ASSERT_TRUE(summary) << summary.error().what;
    EXPECT_EQ(hand_.alive, 0);
  }

  std::atomic<bool> stop_{false};
  std::unique_ptr<Daemon> daemon_;
  std::future<Result<Summary>> ran_;
};

TEST_F(RealTimeDaemonTest, CallsOfManyThreadsAreServedOneAfterAnother) {
  start();
  std::atomic<int> served{0};
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([&, caller] {
      for (int i = 0; i < 5; ++i) {
        Status status;
        switch ((caller + i) % 5) {
          case 0:
            status = daemon_->set_light(0, {{0, 0, 1}, 10.0 + i, {1, 1, 1}});
            break;
          case 1:
            status = daemon_->load_material(at("material.safetensors"));
            break;
          case 2:
            status = daemon_->reload();
            break;
          case 3:
            status = daemon_->snapshot().map([](const auto&) {});
            break;
          default:
            status = daemon_->set_scene(at("scene.toml"));
        }
        EXPECT_TRUE(status) << status.error().what;
        (void)daemon_->status();
        ++served;
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(served, 20);
  // On a busy machine frames are late.
  for (const service::Fault& fault : daemon_->status().faults)
    EXPECT_EQ(fault.kind, FaultKind::kLate) << fault.text;
  end();
}

TEST_F(RealTimeDaemonTest, RecoversFromALostGpuOnTheLoadersThread) {
  start();
  hand_.gpu_lost = true;
  EXPECT_TRUE(wait_until([&] { return daemon_->status().recovered == 1; }));
  EXPECT_EQ(hand_.renderers, 2);
  EXPECT_TRUE(wait_until([&] { return daemon_->status().state == State::kRunning; }));
  EXPECT_TRUE(wait_until([&] { return hand_.alive == 1; })) << "the old one was destroyed";
  end();
}

TEST_F(RealTimeDaemonTest, BlankReturnsWhenItIsDark) {
  start();
  EXPECT_TRUE(daemon_->blank(true));
  EXPECT_TRUE(hand_.dark);
  const std::uint64_t frames = daemon_->frames();
  EXPECT_TRUE(wait_until([&] { return daemon_->frames() > frames + 10; }));
  EXPECT_TRUE(daemon_->blank(false));
  EXPECT_FALSE(hand_.dark);
  end();
}

TEST_F(RealTimeDaemonTest, TellsItsFiguresWhileItRuns) {
  start();
  EXPECT_TRUE(wait_until([&] { return daemon_->frames() > 250; }));
  const auto status = daemon_->status();
  EXPECT_GT(status.frame_rate_hz, 20);
  EXPECT_LE(status.frame_rate_hz, 202);
  EXPECT_NEAR(status.latency_ms.gpu_draw, 0.3, 1e-9);
  EXPECT_NEAR(status.gpu_ms_median, 0.5, 1e-9);
  EXPECT_GE(status.latency_ms.hand_off, 0);
  EXPECT_NE(status.material.find("phong"), std::string::npos) << status.material;
  end();
}

TEST_F(RealTimeDaemonTest, CallsBeforeAndAfterARunAreRefused) {
  auto daemon = Daemon::create(at("veneer.toml"), {}, devices()).value();
  EXPECT_EQ(daemon->reload().error().code, Errc::kUnavailable);
  EXPECT_EQ(daemon->status().state, State::kStarting);
  start();
  end();
  EXPECT_EQ(daemon_->reload().error().code, Errc::kUnavailable);
  EXPECT_EQ(daemon_->snapshot().error().code, Errc::kUnavailable);
}

}  // namespace
}  // namespace veneer::daemon
