// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/file/file_colorimeter.h"

#include <limits>
#include <utility>

namespace veneer::calibration {
namespace {

double distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

}  // namespace

FileColorimeter::FileColorimeter(MeasuredPatches white_reference,
                                 std::optional<MeasuredPatches> object,
                                 const WatchedDisplay& display)
    : display_(display) {
  const auto table_of = [](MeasuredPatches measured) {
    Table table{std::move(measured), {}};
    table.times_read.resize(table.measured.patches.size(), 0);
    return table;
  };
  white_reference_ = table_of(std::move(white_reference));
  if (object) object_ = table_of(*std::move(object));
}

std::string FileColorimeter::description() const {
  const MeasuredPatches& measured = white_reference_->measured;
  return fmt::format(
      "{} readings of {}, from a file",
      measured.patches.size(),
      measured.instrument.empty() ? "an instrument that is not named" : measured.instrument);
}

Result<Xyz> FileColorimeter::read(Target target, const Eigen::Vector2d& /*pixel*/) {
  std::optional<Table>& table = target == Target::kObject ? object_ : white_reference_;
  if (!table)
    return fail(Errc::kNotFound,
                "reading the object from a file: there are readings of the white reference alone; "
                "set object to a .ti3 of the object");
  const std::optional<ShownPatch>& shown = display_.shown();
  if (!shown)
    return fail(Errc::kNotFound,
                "reading from a file: the display shows no uniform patch; show one first");
  if (!shown->lit)
    return fail(Errc::kNotFound,
                "reading from a file: the lamp is off, and a .ti3 has no readings of that; give "
                "the ambient light by hand");
  const std::vector<PatchReading>& patches = table->measured.patches;
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const double d = distance(patches[i].drive, shown->drive);
    if (d < least) {
      least = d;
      nearest = i;
    }
  }
  if (!(least <= kSameDrive))
    return fail(Errc::kNotFound,
                "reading from a file: it has no patch of the drive {:.4f} {:.4f} {:.4f}; measure a "
                "chart that has it",
                shown->drive.x(),
                shown->drive.y(),
                shown->drive.z());
  // The readings of one patch, in turn: those with the very drive of the nearest.
  std::vector<std::size_t> repeats;
  for (std::size_t i = 0; i < patches.size(); ++i)
    if (patches[i].drive == patches[nearest].drive) repeats.push_back(i);
  const std::size_t turn = table->times_read[nearest]++;
  return patches[repeats[turn % repeats.size()]].xyz;
}

}  // namespace veneer::calibration
