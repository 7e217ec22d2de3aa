// SPDX-License-Identifier: Apache-2.0
// What Soak does to files, by calls and to the machine.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <limits>

#include "tests/soak/soak.h"

namespace veneer::soak {

using namespace std::chrono_literals;

void Soak::reload(bool must_succeed) {
  const Status status = daemon_->reload();
  if (must_succeed && !status)
    violate(fmt::format("a reload of good files was refused: {}", status.error().what));
  if (!must_succeed && status) violate("a reload of bad files was taken");
}

void Soak::break_file(Injection injection) {
  switches_.count(injection);
  switch (injection) {
    case Injection::kMaterialCut:
      stage_->cut_material();
      break;
    case Injection::kMaterialGarbage:
      stage_->replace_material(stage_->garbage());
      break;
    case Injection::kMaterialGone:
      stage_->remove_material();
      break;
    case Injection::kMaterialOther:
      stage_->replace_material(stage_->other_material());
      return reload(true);
    case Injection::kProfileDamaged:
      stage_->damage_profile();
      break;
    case Injection::kProfileGone:
      stage_->remove_profile();
      break;
    case Injection::kProfileOther:
      display_.allow(LightMeter(stage_->other_profile()));
      stage_->write_profile(stage_->other_profile());
      reload(true);
      return display_.use(LightMeter(stage_->other_profile()));
    case Injection::kSceneWrong:
      stage_->write_scene("illuminance_lx = 3\n");
      break;
    case Injection::kSceneGone:
      stage_->remove_scene();
      break;
    case Injection::kConfigurationWrong:
      stage_->write_config("frame_rate = 30\n");
      break;
    default:
      return;
  }
  reload(false);
}

void Soak::storm(Injection injection) {
  switches_.count(injection);
  const bool files_are_good = !active_[static_cast<std::size_t>(Group::kFiles)].has_value();
  switch (injection) {
    case Injection::kReloadStorm:
      for (int i = 0; i < 3; ++i) {
        const Status status = daemon_->reload();
        if (files_are_good && !status)
          violate(fmt::format("a reload was refused: {}", status.error().what));
      }
      break;
    case Injection::kMaterialStorm:
      for (const auto& [path, good] : {std::pair{stage_->other_material(), true},
                                       std::pair{stage_->garbage(), false},
                                       std::pair{stage_->scene(), false},
                                       std::pair{stage_->good_material(), true}}) {
        const Status status = daemon_->load_material(path);
        if (status.has_value() != good)
          violate(fmt::format("loading {}: {}",
                              path.filename().string(),
                              status ? "was taken" : status.error().what));
      }
      break;
    case Injection::kLightStorm: {
      service::LightSetting light;
      for (const double lux : {0.0, 1e6, 1.0, 1e6}) {
        light.illuminance_lux = lux;
        light.direction_to_light = {random_.uniform() - 0.5, 0.2, 1};
        light.colour = {1, lux > 1 ? 1e3 : 0, 1};
        if (const Status status = daemon_->set_light(0, light); !status)
          violate(fmt::format("a light of {} lux was refused: {}", lux, status.error().what));
      }
      if (daemon_->set_light(9, light)) violate("a light that the scene has not was set");
      light.illuminance_lux = 2e6;
      if (daemon_->set_light(0, light)) violate("a light of 2e6 lux was taken");
      light.illuminance_lux = std::numeric_limits<double>::quiet_NaN();
      if (daemon_->set_light(0, light)) violate("a light of NaN lux was taken");
      break;
    }
    case Injection::kBlankStorm:
      for (int i = 0; i < 5; ++i) {
        const Status status = daemon_->blank(i % 2 == 0);
        if (status) continue;
        // A display that is away does not say that it is dark.
        if (status.error().code == Errc::kTimeout &&
            active_[static_cast<std::size_t>(Group::kOutput)])
          break;
        violate(fmt::format("blank was refused: {}", status.error().what));
      }
      break;
    case Injection::kConcurrentCalls:
      call_at_once();
      break;
    default:
      break;
  }
}

void Soak::call_at_once() {
  std::vector<std::jthread> callers;
  for (int i = 0; i < 4; ++i) {
    callers.emplace_back([this, i] {
      for (int k = 0; k < 10; ++k) {
        static_cast<void>(daemon_->status());
        static_cast<void>(daemon_->frames());
        // On a virtual clock only the thread that draws can be told something.
        if (options_.virtual_time) continue;
        if (i == 0) static_cast<void>(daemon_->reload());
        if (i == 1) static_cast<void>(daemon_->load_material(stage_->good_material()));
        if (i == 2) static_cast<void>(daemon_->snapshot());
      }
    });
  }
}

void Soak::write_when_full() {
  const bool full = switches_.is_on(Injection::kDiskFull);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  if (full) {
    // Nothing is as short as this.
    const rlimit none{16, before.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &none);
    switches_.count(Injection::kDiskFull);
  } else {
    stage_->block_state(true);
    switches_.count(Injection::kDiskGone);
  }
  if (daemon_->snapshot()) violate("a snapshot was written where nothing can be written");
  if (full) ::setrlimit(RLIMIT_FSIZE, &before);
}

void Soak::jump(Duration by) {
  Clock& clock = *clock_.load();
  switches_.count(by > 1min ? Injection::kSuspended : Injection::kClockJump);
  jumped_ += by;
  clock.sleep_until(clock.now() + by);
}

void Soak::stop_for_a_second() {
  switches_.count(Injection::kStopped);
  const pid_t us = ::getpid();
  const pid_t child = ::fork();
  if (child == 0) {
    // Only what is safe after a fork.
    ::kill(us, SIGSTOP);
    const timespec second{1, 0};
    ::nanosleep(&second, nullptr);
    ::kill(us, SIGCONT);
    ::_exit(0);
  }
  if (child > 0) ::waitpid(child, nullptr, 0);
}

}  // namespace veneer::soak
