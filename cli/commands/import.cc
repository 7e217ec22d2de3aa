// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "btf/importers/importer.h"
#include "btf/sample_set.h"
#include "cli/commands/commands.h"

namespace veneer::cli {

Result<int> run_import(CommandLine& line) {
  std::string name;
  std::filesystem::path source;
  std::filesystem::path out;
  std::vector<int> crop;
  std::string names;
  for (const btf::Importer& importer : btf::importers()) {
    names += fmt::format("\n  {}: {}", importer.name, importer.summary);
  }
  line.app().add_option("format", name, "What the source is:" + names)->required();
  line.app().add_option("source", source, "File or folder to read")->required();
  line.app().add_option("-o,--output", out, "The sample set to write, NAME.btfset")->required();
  line.app()
      .add_option("--crop", crop, "Keep only the texels x,y,width,height")
      ->delimiter(',')
      ->expected(4);
  btf::ImportOptions options;
  line.app()
      .add_option("--directions",
                  options.directions,
                  "Where to sample a BRDF (merl, utia): bonn81 or ubo151")
      ->capture_default_str();
  line.parse();

  VENEER_ASSIGN(const btf::Importer* importer, btf::find_importer(name));
  if (!crop.empty()) options.crop = btf::Crop{crop[0], crop[1], crop[2], crop[3]};
  VENEER_TRY(importer->run(source, out, options, line.progress()));
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(out));
  const btf::SampleSetInfo& info = set.info();
  line.print({{"set", out.string()},
              {"width", info.width},
              {"height", info.height},
              {"views", info.views.size()},
              {"lights", info.lights.size()}},
             fmt::format("wrote {}: {} x {} texels, {} views, {} lights",
                         out.string(),
                         info.width,
                         info.height,
                         info.views.size(),
                         info.lights.size()));
  return kExitDone;
}

}  // namespace veneer::cli
