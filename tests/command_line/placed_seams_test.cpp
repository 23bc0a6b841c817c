// Placed seams in the real nodald, and in `nodal render` of a take that it recorded.
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

class PlacedSeamsTest : public RigTest {
 protected:
  using Raymaps = std::map<std::uint64_t, std::string>;  ///< by set

  void place_seams(const std::string& more = "") {
    std::string toml = read("rig.toml");
    const auto insert = [&](const std::string& after, const std::string& text) {
      ASSERT_NE(toml.find(after), std::string::npos);
      toml.insert(toml.find(after) + after.size(), text);
    };
    insert("[raymap]\n", "seams = \"placed\"\n");
    insert("folder = \"store\"\n", "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n" + more);
    insert("[sim]\n", "noise = 2\nscene = \"bar\"\n");
    write("rig.toml", toml);
    start_nodald();
    bring_up();
  }
  Raymaps raymaps_of(const std::vector<Json>& said) const {
    Raymaps raymaps;
    for (const Json& line : said) {
      if (!line.contains("raymap")) continue;
      const std::string file = line["raymap"]["file"];
      raymaps[line["raymap"]["set"].get<std::uint64_t>()] = read(std::filesystem::path(file).filename().string());
    }
    return raymaps;
  }
  Raymaps pulled(const std::string& name, int count = 40) const {
    return raymaps_of(
        nodal_json({"raymap", "pull", "-n", std::to_string(count), "--lossless", "--out", path(name + "-%04d.raw")}));
  }
  Raymaps rendered(Words more = {}) const {
    Words words{"render", path("takes/000001"), "-o", path("later-%04d.raw")};
    words.insert(words.end(), more.begin(), more.end());
    return raymaps_of(nodal_json(words));
  }
  Json seams() const { return nodal_json({"status"}).at(0)["seams"]; }
  /// How many of the live raymaps are among the rendered ones; they have to have the same bytes.
  static std::size_t compared(const Raymaps& live, const Raymaps& later) {
    std::size_t count = 0;
    for (const auto& [set, bytes] : live) {
      const auto found = later.find(set);
      if (found == later.end()) continue;
      EXPECT_EQ(found->second == bytes, true) << "set " << set;
      ++count;
    }
    return count;
  }
};

/// Seams move before and during the take; a calibration that is swapped meanwhile begins with its own.
TEST_F(PlacedSeamsTest, ATakeThatIsRendered_HasTheSeamsThatTheRigHad) {
  Calibration other = six_heads("other");
  for (HeadCalibration& head : other.heads) head.center_x += 3;
  write("other.json", to_json(other));
  place_seams();
  const auto placed = [&] { return seams()["placed"].get<int>(); };
  ASSERT_TRUE(wait_until([&] { return placed() >= 1; })) << "before the take";
  ASSERT_EQ(nodal({"take", "start"}).code, 0);
  const int before = placed();
  Raymaps live;
  for (int k = 0; k < 20 && placed() < before + 2; ++k) live.merge(pulled("one-" + std::to_string(k)));
  EXPECT_GE(placed(), before + 2) << "they follow the bar";
  ASSERT_EQ(nodal({"calibration", "upload", path("other.json")}).code, 0);
  live.merge(pulled("two"));
  EXPECT_EQ(seams()["refused"], 0);
  EXPECT_NE(nodal({"status"}).out.find("placed anew "), std::string::npos);
  ASSERT_EQ(nodal({"take", "stop"}).code, 0);
  const int moved = placed() - before;
  const Json shown = nodal_json({"take", "show", path("takes/000001")}).at(0);
  const Json& summary = shown["seams"];
  EXPECT_GE(summary["changes"], 2) << summary;
  EXPECT_LE(summary["changes"], moved + 1) << "and the calibration's own, once";
  EXPECT_LE(summary["placed_sets"], shown["sets"]);
  EXPECT_GE(summary["placed_sets"], shown["sets"].get<int>() - 24)
      << "not before the other calibration's first placement";
  EXPECT_GE(summary["first_change_ns"], 0);
  EXPECT_LT(summary["first_change_ns"], summary["last_change_ns"]);
  EXPECT_LE(summary["last_change_ns"], shown["length_ns"]);
  const Finished text = nodal({"take", "show", path("takes/000001")});
  EXPECT_NE(text.out.find("placed seams in " + to_string(summary["placed_sets"]) + " of "), std::string::npos)
      << text.out;
  EXPECT_NE(text.out.find(", which changed " + to_string(summary["changes"]) + " times, first at "), std::string::npos);
  const Raymaps later = rendered();
  EXPECT_GE(compared(live, later), 70U);
  EXPECT_EQ(rendered({"--threads", "1"}), later);
  const Raymaps part = rendered({"--from", "0.8s"});
  EXPECT_EQ(compared(part, later), part.size()) << "also from the middle on";
}

/// Recovery cuts what is not durable; the seams of what is left are there.
TEST_F(PlacedSeamsTest, ATakeOfANodaldThatWasKilled_HasThemToo) {
  place_seams();
  ASSERT_EQ(nodal({"take", "start"}).code, 0);
  const Raymaps live = pulled("live");
  wait_until_durable();
  nodald().signal(SIGKILL);
  nodald().wait();
  start_nodald();
  ASSERT_TRUE(wait_until([&] { return std::filesystem::exists(path("takes/000001/manifest")); }));
  EXPECT_GE(compared(live, rendered()), 35U);
}

/// With another calibration the recorded seams are not its own: they begin with fixed ones and are placed anew.
TEST_F(PlacedSeamsTest, ATakeThatIsRenderedWithAnotherCalibration_HasFixedSeamsInItsFirstPeriodAndPlacedOnesLater) {
  place_seams();
  ASSERT_EQ(nodal({"take", "start"}).code, 0);
  pulled("live");
  ASSERT_EQ(nodal({"take", "stop"}).code, 0);
  const Raymaps all = rendered({"--calibration", path("six.json")});
  ASSERT_GE(all.size(), 40U);
  EXPECT_EQ(rendered({"--calibration", path("six.json"), "--threads", "1"}), all);
  // 0.8 s is in set 20 of the take.
  const Raymaps later = rendered({"--calibration", path("six.json"), "--from", "0.8s"});
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
