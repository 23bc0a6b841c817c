// rig_from_truth FOLDER OUT: writes OUT/calibration.json and OUT/rig.toml from a rendered rig's rig_gt.json, so that
// nodald replays its pictures and its raymap can be compared with the true sphere.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/data/truth_rig.h"

namespace {

bool write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) std::fprintf(stderr, "rig_from_truth: cannot write %s\n", file.c_str());
  return static_cast<bool>(out);
}

}  // namespace

int main(int argc, char** argv) {
  namespace fs = std::filesystem;
  CLI::App app{"Turns a rendered rig's folder (rig_gt.json and pictures) into a calibration and a rig.toml"};
  std::string folder, out, format = "RGB24";
  int width = 2048;
  app.add_option("FOLDER", folder, "holds rig_gt.json and the pictures")->required();
  app.add_option("OUT", out, "gets calibration.json and rig.toml")->required();
  app.add_option("--format", format, "of heads and raymap")->check(CLI::IsMember({"RGB24", "I420", "GREY"}));
  app.add_option("--width", width, "of the equirectangular raymap, px")->check(CLI::Range(16, 16384));
  CLI11_PARSE(app, argc, argv);

  const fs::path truth = fs::path(folder) / "rig_gt.json";
  std::ifstream in(truth, std::ios::binary);
  if (!in) {
    std::fprintf(stderr, "rig_from_truth: there is no %s\n", truth.c_str());
    return 1;
  }
  std::ostringstream text;
  text << in.rdbuf();
  const nodal::Result<nodal::test_data::TruthRig> rig = nodal::test_data::read_truth_rig(text.str());
  if (!rig) {
    std::fprintf(stderr, "rig_from_truth: %s: %s\n", truth.c_str(), rig.error().text().c_str());
    return 1;
  }
  for (const std::string& image : rig->images) {
    if (!fs::exists(fs::path(folder) / image)) {
      std::fprintf(stderr, "rig_from_truth: there is no %s in %s\n", image.c_str(), folder.c_str());
      return 1;
    }
  }
  std::error_code error;
  fs::create_directories(out, error);
  const std::string absolute = fs::canonical(folder, error).string();
  const bool good = write(fs::path(out) / "calibration.json", nodal::to_json(rig->calibration)) &&
                    write(fs::path(out) / "rig.toml", nodal::test_data::replay_rig_toml(*rig, absolute, format, width));
  if (good) std::printf("%zu heads: %s/calibration.json, %s/rig.toml\n", rig->images.size(), out.c_str(), out.c_str());
  return good ? 0 : 1;
}
