// Placed seams in the real nodald, and in `nodal render` of a take that it recorded.
#include <cstdint>
#include <filesystem>
#include <map>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

class PlacedSeamsTest : public RigTest {
 protected:
  using Raymaps = std::map<std::uint64_t, std::string>;  ///< by set
  Raymaps rendered(Words more = {}) const {
    Words words{"render", path("takes/000001"), "-o", path("later-%04d.raw")};
    words.insert(words.end(), more.begin(), more.end());
    Raymaps raymaps;
    for (const Json& line : nodal_json(words)) {
      if (!line.contains("raymap")) continue;
      const std::string file = line["raymap"]["file"];
      raymaps[line["raymap"]["set"].get<std::uint64_t>()] = read(std::filesystem::path(file).filename().string());
    }
    return raymaps;
  }
};

TEST_F(PlacedSeamsTest, ATakeThatIsRendered_HasFixedSeamsInItsFirstPeriodAndPlacedOnesLater) {
  std::string toml = read("rig.toml");
  const auto insert = [&](const std::string& after, const std::string& text) {
    ASSERT_NE(toml.find(after), std::string::npos);
    toml.insert(toml.find(after) + after.size(), text);
  };
  insert("[raymap]\n", "seams = \"placed\"\n");
  insert("folder = \"store\"\n", "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n");
  insert("[sim]\n", "noise = 2\n");
  write("rig.toml", toml);
  start_nodald();
  bring_up();
  EXPECT_EQ(nodal({"take", "start"}).code, 0);
  EXPECT_EQ(nodal({"raymap", "pull", "-n", "40", "--lossless", "--out", path("live-%04d.raw")}).code, 0);
  EXPECT_EQ(nodal({"take", "stop"}).code, 0);
  const Raymaps all = rendered();
  ASSERT_GE(all.size(), 40U);
  EXPECT_EQ(rendered({"--threads", "1"}), all);
  const Raymaps later = rendered({"--from", "0.8s"});  // begins again with fixed seams, in set 20 of the take
  constexpr std::uint64_t kPeriod = 8;
  const std::uint64_t first = later.begin()->first;
  ASSERT_GE(first / kPeriod, all.begin()->first / kPeriod + 2);
  for (const auto& [set, bytes] : later) {
    if (set / kPeriod != first / kPeriod) break;
    EXPECT_NE(bytes, all.at(set)) << "set " << set;
  }
}

}  // namespace
}  // namespace nodal::command_line
