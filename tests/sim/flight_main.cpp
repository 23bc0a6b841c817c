// Steps the firmware through the flight record of a take.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/config.h"
#include "flight_player.h"
#include "flight_reader.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::flight {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

constexpr int kDifferent = 1, kUnreadable = 2;
constexpr std::uintmax_t kMaxBytes = std::uintmax_t{2} << 30;

constexpr const char* kHelp =
    "flight TAKE: steps the firmware through the flight record of a take ([takes] flight_recorder)\n"
    "  Compares every exposure, setting, loss, genlock state and set, also with the take's evidence, and names the "
    "first\n"
    "  event that differs. Exit codes: 0 no difference, 1 a difference, 2 the take cannot be read\n";

Result<Bytes> read(const fs::path& path) {
  std::error_code none;
  const std::uintmax_t size = fs::file_size(path, none);
  if (none) return fail(Errc::kNotFound, fmt::format("{}: {}", path.string(), none.message()));
  if (size > kMaxBytes) return fail(Errc::kTooLarge, path.string() + ": is larger than 2 GiB");
  std::ifstream file(path, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(file), {});
}

/// What the take's evidence says of each set, by the rig's number.
class Evidence {
 public:
  Status load(const fs::path& take) {
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(take, none)) {
      const std::string name = entry.path().filename().string();
      if (!name.starts_with("evidence-") || !take::is_take_file(name)) continue;
      const auto bytes = read(entry.path());
      if (!bytes) return fail(bytes.error());
      auto segment = take::read_evidence(*bytes, entry.path().string());
      if (!segment && segment.error().code == Errc::kTruncated) continue;
      if (!segment) return fail(segment.error());
      for (const take::wire::Set& set : segment->sets) sets_[set.number()] = {set, heads_of(*segment)};
    }
    return {};
  }
  /// The first difference; empty: there is none, or the take has not this set.
  std::string compare(const firmware::FrameSet& set) {
    const auto found = sets_.find(set.number);
    if (found == sets_.end()) return "";
    const take::wire::Set& recorded = found->second.set;
    std::string wrong;
    const auto same = [&](std::string_view what, auto then, auto now) {
      if (then != now && wrong.empty()) wrong = fmt::format("set {}: {} {}; now: {}", set.number, what, then, now);
    };
    same("genlock", std::string_view(recorded.genlock()), firmware::genlock_state_name(set.sync.state));
    same("mid-exposure, ns:", recorded.mid_exposure_ns(), set.mid_exposure.ns());
    // 0: no pulse belongs to the set.
    same("pulse, counted from 1:", recorded.has_pulse() ? recorded.pulse() + 1 : 0,
         set.sync.trigger ? *set.sync.trigger + 1 : 0);
    same("spread, ns:", static_cast<std::int64_t>(recorded.spread_ns()), set.sync.spread.ns());
    same("drift, ppb:", recorded.drift_ppb(), set.sync.drift_ppb.value_or(0));
    for (const take::wire::Frame& frame : recorded.frames()) {
      const auto head = found->second.heads.find(frame.file());
      if (head == found->second.heads.end()) continue;
      const std::string name = fmt::format("head {}: ", head->second);
      same(name + "frames", frame.placeholder() == "missing" ? 0 : 1, set.has(head->second) ? 1 : 0);
      if (!set.has(head->second) || !frame.placeholder().empty()) continue;
      const hal::FrameView& now = set.frames[head->second];
      same(name + "sequence", frame.sequence(), now.sequence);
      same(name + "exposure, ns:", static_cast<std::int64_t>(frame.exposure_ns()),
           now.in_effect.exposure.duration().ns());
      same(name + "gain, mdB:", frame.gain_mdb(), now.in_effect.gain.mdb());
      same(name + "offset, ns:", frame.offset_ns(), set.sync.offset[head->second].ns());
    }
    sets_.erase(found);
    ++compared_;
    return wrong;
  }
  std::uint64_t compared() const { return compared_; }
  std::size_t left() const { return sets_.size(); }

 private:
  using HeadsByFile = std::map<std::uint32_t, std::size_t>;
  static HeadsByFile heads_of(const take::Segment& segment) {
    HeadsByFile heads;
    for (int file = 0; file < segment.begin.files_size(); ++file) {
      if (segment.begin.files(file).has_head())
        heads[static_cast<std::uint32_t>(file)] = segment.begin.files(file).head();
    }
    return heads;
  }
  struct Told {
    take::wire::Set set;
    HeadsByFile heads;
  };
  std::map<std::uint64_t, Told> sets_;
  std::uint64_t compared_ = 0;
};

int unreadable(const Error& error) {
  std::fprintf(stderr, "error: %s\n", error.text().c_str());
  return kUnreadable;
}

int run(const fs::path& take) {
  const auto text = read(take / take::kRigFile);
  if (!text) return unreadable(text.error());
  const auto config = firmware::parse_rig_config({reinterpret_cast<const char*>(text->data()), text->size()},
                                                 (take / take::kRigFile).string());
  if (!config) return unreadable(config.error());
  const auto bytes = read(take / take::kFlightFile);
  if (!bytes) return unreadable(bytes.error().in("the take has no flight record ([takes] flight_recorder)"));
  auto reader = FlightReader::open(*bytes, (take / take::kFlightFile).string());
  if (!reader) return unreadable(reader.error());
  Evidence evidence;
  if (const Status loaded = evidence.load(take); !loaded) return unreadable(loaded.error());
  FlightPlayer player(*config, *reader);
  std::string beside;
  std::uint64_t sets = 0;
  player.on_set = [&](const firmware::FrameSet& set) {
    ++sets;
    const std::string wrong = evidence.compare(set);
    if (beside.empty()) beside = wrong;
  };
  const auto played = player.play();
  if (!played) return unreadable(played.error());
  std::string difference;
  if (*played) difference = (*played)->text();
  else if (!beside.empty()) difference = "the evidence, " + beside;
  std::printf(
      "%s: %llu steps, %llu events and %llu sets in %.3f s of nodald's time; %llu sets compared with the evidence\n",
      take.string().c_str(), static_cast<unsigned long long>(player.steps()),
      static_cast<unsigned long long>(player.events()), static_cast<unsigned long long>(sets),
      static_cast<double>((player.until() - player.from()).ns()) / 1e9,
      static_cast<unsigned long long>(evidence.compared()));
  if (difference.empty() && evidence.left() > 0 && reader->ended() == "the take ended")
    difference = fmt::format("{} sets of the evidence do not come", evidence.left());
  if (!difference.empty()) {
    std::printf("first difference: %s\n", difference.c_str());
    return kDifferent;
  }
  if (evidence.left() > 0) {
    std::printf("the record ends before the take, with %zu sets that were not compared: %s\n", evidence.left(),
                reader->ended().empty() ? "it was cut off" : reader->ended().c_str());
  }
  std::printf("no difference\n");
  return 0;
}

}  // namespace
}  // namespace nodal::flight

int main(int argc, char** argv) {
  if (argc != 2 || argv[1][0] == '-') {
    std::fputs(nodal::flight::kHelp, stderr);
    return nodal::flight::kUnreadable;
  }
  return nodal::flight::run(argv[1]);
}
