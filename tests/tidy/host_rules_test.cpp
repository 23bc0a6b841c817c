// What the host's code leaves to one place: messages of a rig, waits for it, programs that are started, colours of
// pictures.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tree.h"

namespace nodal::tidy {
namespace {

struct Rule {
  std::string call;                 ///< name of a function
  std::vector<std::string> places;  ///< beginnings of the paths that may call it
  std::string why;
};

void expect_rule(const std::vector<std::string>& folders, const Rule& rule) {
  int allowed = 0;
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path)) continue;
    if (std::ranges::none_of(folders, [&](const auto& folder) { return file.path.starts_with(folder); })) continue;
    const bool may =
        std::ranges::any_of(rule.places, [&](const std::string& place) { return file.path.starts_with(place); });
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      const std::string code = file.lines[i].substr(0, file.lines[i].find("//"));
      if (code.find(rule.call) == std::string::npos) continue;
      allowed += may ? 1 : 0;
      EXPECT_TRUE(may) << file.path << ":" << i + 1 << " calls " << rule.call << ": " << rule.why;
    }
  }
  if (rule.places.empty()) return;
  EXPECT_GT(allowed, 0) << rule.call << " is called nowhere; is the rule still right?";
}

TEST(HostRules, MessagesOfARig_AreParsedAndCleanedInOnePlace) {
  expect_rule({"host_tool/"}, {"ParseFrom", {"host_tool/rig/"}, "parse_clean() makes its texts printable"});
}

TEST(HostRules, WaitsForAStreamOfARig_HaveAFloorOfProgress) {
  expect_rule(
      {"host_tool/"},
      {"next_event", {"host_tool/rig/", "host_tool/commands/raymap.cpp"}, "StreamWait gives up a rig that trickles"});
}

TEST(HostRules, ProgramsAreStarted_WhereTheirRightsAreKnown) {
  const std::vector<std::string> host{"host_tool/", "stitch/", "protocol/", "hal/linux/link/", "hal/linux/cable/"};
  const std::string why = "confinement.cpp must permit a program before it can be started";
  expect_rule(host, {"posix_spawnp(", {"hal/linux/link/spawn_link.cpp", "host_tool/input/pairs_file.cpp"}, why});
  expect_rule(
      host,
      {"fork()", {"hal/linux/link/link_helper.cpp", "host_tool/look/loopback.cpp", "host_tool/child/child.cpp"}, why});
}

TEST(HostRules, PicturesAreReadAndWritten_WhereTheirColoursAreKept) {
  const std::vector<std::string> readers{"host_tool/input/pictures.cpp"}, none;
  const std::string read = "read_picture() converts to sRGB whatever the file says that its numbers stand for";
  expect_rule({"host_tool/"}, {"media::read_image(", none, read});
  expect_rule({"host_tool/"}, {"media::read_tiff(", none, read});
  // A film's pictures are a rig's, in sRGB's numbers.
  expect_rule({"host_tool/"},
              {"media::decode_image(", {"host_tool/input/pictures.cpp", "host_tool/look/sphere.cpp"}, read});
  expect_rule({"host_tool/"}, {"media::decode_tiff(", readers, read});
  expect_rule({"host_tool/"}, {"media::decode_heif_or_webp(", readers, read});
  const std::string written = "media::encode() writes what numbers stand for, and the metadata that is kept";
  expect_rule({"host_tool/"}, {"media::tiff_file(", none, written});
  expect_rule({"host_tool/"},
              {"media::png_file(",
               {"host_tool/commands/pattern.cpp", "host_tool/commands/replay_toml.cpp", "host_tool/report/"},
               written});
  // Only hosts link Little CMS and pugixml's reader of XMP.
  expect_rule({"host_tool/", "stitch/", "firmware/", "hal/"},
              {"in_srgb(", {"stitch/media/colour/", "host_tool/input/pictures.cpp"}, read});
}

TEST(HostRules, EndingsOfNames_AreComparedInAnyCase) {
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path) || !(file.path.starts_with("host_tool/") || file.path.starts_with("stitch/mesh/")))
      continue;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      EXPECT_EQ(file.lines[i].find("ends_with(\"."), std::string::npos)
          << file.path << ":" << i + 1 << ": a camera writes .JPG; call has_ending() (protocol/base/file_ending.h)";
    }
  }
}

}  // namespace
}  // namespace nodal::tidy
