// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <string>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "btf/models/internal_test_models.h"
#include "calibration/profile_store.h"
#include "daemon/daemon.h"
#include "daemon/testing/fakes.h"
#include "render/internal_testing.h"

namespace veneer::daemon::testing {

/// The files that a daemon reads, and devices that fail when the stagehand says so.
class DaemonFixture : public ::testing::Test {
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
      return std::make_unique<MovingTracker>(
          clock, clock.now() + std::chrono::milliseconds(1), Time::max(), &hand_);
    };
    devices.open_output = [this]() -> Result<std::unique_ptr<projector::Output>> {
      if (hand_.output_refuses) return fail(Errc::kNotFound, "there is no display");
      ++hand_.outputs;
      return std::make_unique<FakeOutput>(hand_);
    };
    devices.make_renderer = [this](const render::Scene& scene,
                                   std::span<const render::Level>,
                                   const calibration::ProjectorProfile& profile,
                                   const render::RendererOptions& options,
                                   const Scanout*) -> Result<std::unique_ptr<render::Renderer>> {
      if (hand_.renderer_refuses) return fail(Errc::kUnavailable, "there is no GPU");
      ++hand_.renderers;
      profile_distance_m_ = profile.reference_distance_m;
      lux_ = std::get<render::DirectionalLight>(scene.lights.at(0)).illuminance_rgb.x();
      return std::make_unique<FakeRenderer>(hand_, static_cast<int>(options.luminance_ceiling));
    };
    devices.memory_pressure = [this]() -> Result<double> { return pressure_.load(); };
    return devices;
  }

  static inline TemporaryFolder* folder_ = nullptr;
  Stagehand hand_;
  std::atomic<double> lux_{0};                 ///< of the scene that the last renderer was made for
  std::atomic<double> profile_distance_m_{0};  ///< of its profile
  std::atomic<double> pressure_{0};            ///< of memory
};

}  // namespace veneer::daemon::testing
