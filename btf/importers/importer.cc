// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/importer.h"

#include <algorithm>
#include <array>
#include <string>

#include "btf/importers/btfbase/btfbase.h"
#include "btf/importers/crop.h"
#include "btf/importers/merl/merl.h"
#include "btf/importers/rgl/rgl.h"
#include "btf/importers/rti/rti.h"
#include "btf/importers/ubo2003/ubo2003.h"
#include "btf/importers/ubo2014/ubo2014.h"
#include "btf/importers/utia/utia.h"

namespace veneer::btf {
namespace {

constexpr std::array kImporters{
    Importer{"btfbase",
             "text code-books of multi-level vector quantisation (Havran 2010)",
             &import_btfbase},
    Importer{"merl", "an isotropic BRDF of the MERL database (.binary)", &import_merl},
    Importer{"rgl", "a BRDF of the RGL material database (.bsdf, the RGB variant)", &import_rgl},
    Importer{"rti", "a fixed camera and many lights: a .lp file and its pictures", &import_rti},
    Importer{"ubo2003",
             "a BTF of the University of Bonn as pictures (UBO2003, ATRIUM: a zip or a folder)",
             &import_ubo2003},
    Importer{"ubo2014", "a BTF of the University of Bonn (.btf)", &import_ubo2014},
    Importer{"utia", "an anisotropic BRDF of the UTIA database (.bin)", &import_utia},
};
static_assert(std::ranges::is_sorted(kImporters, {}, &Importer::name));

}  // namespace

std::span<const Importer> importers() { return kImporters; }

Result<const Importer*> find_importer(std::string_view name) {
  for (const Importer& importer : kImporters) {
    if (importer.name == name) return &importer;
  }
  std::string known;
  for (const Importer& importer : kImporters) known += fmt::format(" {}", importer.name);
  return fail(Errc::kInvalidOption, "there is no importer \"{}\"; there are:{}", name, known);
}

Result<Crop> crop_of(const ImportOptions& options, int width, int height, std::string_view doing) {
  if (!options.crop) return Crop{0, 0, width, height};
  const Crop crop = *options.crop;
  // Compared without sums, which could overflow.
  const bool inside = crop.x >= 0 && crop.y >= 0 && crop.width > 0 && crop.height > 0 &&
                      crop.x < width && crop.y < height && crop.width <= width - crop.x &&
                      crop.height <= height - crop.y;
  if (!inside)
    return fail(Errc::kInvalidOption,
                "{}: the crop {},{},{},{} does not lie inside the source's {} x {} texels",
                doing,
                crop.x,
                crop.y,
                crop.width,
                crop.height,
                width,
                height);
  return crop;
}

}  // namespace veneer::btf
