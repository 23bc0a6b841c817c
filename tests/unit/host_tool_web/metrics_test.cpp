// The metrics of the largest rig and of any names.
#include "host_tool/web/metrics.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>

namespace nodal::host::web {
namespace {

void add_losses(google::protobuf::RepeatedPtrField<wire::Count>& to, std::uint64_t frames) {
  for (const char* reason :
       {"late", "duplicate", "corrupt", "incomplete", "bad-time", "disconnected", "no-set", "other"}) {
    wire::Count& count = *to.Add();
    count.set_reason(reason);
    count.set_frames(frames++);
  }
}

RigDesk::State largest() {
  RigDesk::State state;
  state.status.set_state("running");
  state.status.set_frames_in_sets(1'000'000'000'000);
  state.status.set_frames_held(3);
  add_losses(*state.status.mutable_losses(), 5);
  add_losses(*state.status.mutable_set_losses(), 1);
  std::uint64_t lost = 0;
  for (const wire::Count& count : state.status.losses()) lost += count.frames();
  state.status.set_frames_taken(1'000'000'000'000 + 3 + lost);
  state.status.mutable_recording()->set_take(1);
  for (int k = 0; k < 16; ++k) {
    wire::HeadState& head = *state.heads.add_heads();
    head.set_name("cam" + std::to_string(k));
    head.set_skew_ns(-1500);
    add_losses(*head.mutable_losses(), 7);
  }
  return state;
}

/// Values by series; expects that none appears twice, and that each belongs to the metric that its comments announced.
std::map<std::string, std::string> series_of(const std::string& text) {
  std::map<std::string, std::string> series;
  std::set<std::string> announced;
  std::istringstream lines(text);
  for (std::string line, name; std::getline(lines, line);) {
    if (line.starts_with("# TYPE ")) {
      name = line.substr(7, line.find(' ', 7) - 7);
      EXPECT_TRUE(announced.insert(name).second) << line;
      EXPECT_EQ(line.ends_with(" counter"), name.ends_with("_total")) << line;
    }
    if (line.starts_with('#')) continue;
    const std::size_t blank = line.rfind(' ');
    EXPECT_EQ(line.substr(0, line.find_first_of("{ ")), name);
    EXPECT_TRUE(series.emplace(line.substr(0, blank), line.substr(blank + 1)).second) << line;
  }
  return series;
}

TEST(Metrics, OfTheLargestRig_AreFewAndItsFramesAddUp) {
  const auto series = series_of(metrics_text(largest()));
  EXPECT_LE(series.size(), 400u);
  EXPECT_GT(series.size(), 100u);
  std::uint64_t sum =
      std::stoull(series.at("nodal_frames_in_sets_total")) + std::stoull(series.at("nodal_frames_held"));
  for (const auto& [name, value] : series)
    if (name.starts_with("nodal_frames_lost_total{")) sum += std::stoull(value);
  EXPECT_EQ(sum, std::stoull(series.at("nodal_frames_taken_total")));
  EXPECT_EQ(series.at("nodal_head_skew_seconds{head=\"cam3\"}"), "-0.000001500");
  EXPECT_EQ(series.at("nodal_head_lost_frames_total{head=\"cam15\"}"), "84") << "7 + 8 + ... + 14";
}

TEST(Metrics, ManyHeadsWithHostileNames_StayWithinTheLimitAndTheFormat) {
  RigDesk::State state = largest();
  for (int k = 0; k < 500; ++k) state.heads.add_heads()->set_name("a\"} 1\nnodal_up 0 \\" + std::to_string(k));
  const std::string text = metrics_text(state);
  EXPECT_EQ(text.find("\nnodal_up 0"), std::string::npos);
  EXPECT_LE(series_of(text).size(), 400u);
}

}  // namespace
}  // namespace nodal::host::web
