// Flight records of simulated rigs with faults: played by the same firmware, and by one with a planted bug.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "flight_stand.h"
#include "protocol/framing.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/support/process.h"

namespace nodal::flight {
namespace {

namespace fs = std::filesystem;
/// Everything that befalls a rig, within some seconds.
void suffer(Stand& stand, TestHost& host) {
  stand.world.head(0).corrupt_next_frame();
  stand.world.head(1).tear_next_frame();
  stand.world.head(2).duplicate_next_frame();
  stand.world.head(3).lose_frames(5);
  stand.world.head(4).delay_next_frame(Duration::milliseconds(150));
  stand.run(Duration::milliseconds(500));
  for (int k = 0; k < 4; ++k) {
    stand.world.trigger().lose_pulse();
    stand.run(Duration::milliseconds(120));
  }
  stand.world.head(2).unplug();
  stand.run(Duration::milliseconds(700));
  EXPECT_TRUE(
      ask(host, [](wire::Request& request) { request.mutable_head_set()->set_exposure_ns(4'000'000); }).has_done());
  TestHost& other = stand.connect();
  stand.world.head(2).replug();
  stand.run(Duration::milliseconds(800));
  EXPECT_TRUE(
      ask(other, [](wire::Request& request) { request.mutable_exposure()->set_program("joint"); }).has_exposure());
  stand.world.head(5).set_light(0.3);
  stand.run(Duration::seconds(1));
  EXPECT_TRUE(
      ask(other, [](wire::Request& request) { request.mutable_head_set()->set_exposure_ns(3'000'000); }).has_error())
      << "the program sets exposures: the request fails, and that is recorded";
  stand.takes->set_speed(&stand.world.clock(), 300'000);
  stand.run(Duration::milliseconds(700));
  stand.takes->set_speed(&stand.world.clock(), 0);
  EXPECT_TRUE(ask(host, [](wire::Request& request) {
                request.mutable_genlock()->set_action(wire::GenlockRequest::STOP);
              }).has_genlock());
  stand.run(Duration::milliseconds(400));
  stand.lock(host);
}

/// A temporary folder that gets takes of a simulated disk.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "flight-XXXXXX").string();
    path = ::mkdtemp(name.data());
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  void copy(hal::sim::SimDisk& disk, const std::string& take) const {
    fs::create_directories(path / take);
    const auto files = disk.list(take);
    ASSERT_TRUE(files) << files.error().text();
    for (const std::string& file : *files) {
      const auto bytes = disk.read(take + "/" + file, std::uint64_t{1} << 30);
      ASSERT_TRUE(bytes) << bytes.error().text();
      std::ofstream(path / take / file, std::ios::binary)
          .write(reinterpret_cast<const char*>(bytes->data()), static_cast<std::streamsize>(bytes->size()));
    }
  }
  fs::path path;
};

/// A take that began after the rig was hit, and during which it is hit again.
const Folder& filmed() {
  static const std::unique_ptr<Folder> folder = [] {
    auto made = std::make_unique<Folder>();
    StandOptions placed = flying_rig();
    placed.config.raymap.seams = SeamPlacement::kPlaced;
    Stand stand(placed);
    TestHost& host = stand.bring_up();
    stand.lock(host);
    stand.world.head(1).unplug();
    stand.run(Duration::milliseconds(300));
    stand.world.head(1).replug();
    stand.run(Duration::milliseconds(500));
    start_take(host);
    suffer(stand, host);
    stop_take(host);
    made->copy(*stand.takes, "000001");
    return made;
  }();
  return *folder;
}

Bytes bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(file), {});
}

/// The record with its events changed by `edit`.
Bytes edited(const Bytes& bytes, const std::function<void(take::flight::Record&)>& edit) {
  Bytes out;
  FrameDecoder decoder;
  std::uint32_t sequence = 0;
  for (std::span<const std::uint8_t> rest = bytes; !rest.empty();) {
    const auto frame = decoder.next(rest);
    if (!frame || !*frame) break;
    take::flight::Record record;
    EXPECT_TRUE(record.ParseFromArray((*frame)->payload.data(), static_cast<int>((*frame)->payload.size())));
    edit(record);
    const std::string payload = record.SerializeAsString();
    const std::span text(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
    const auto head = encode_frame_header({FrameType::kTakeRecord, 0, 0, sequence++}, text);
    out.insert(out.end(), head.begin(), head.end());
    out.insert(out.end(), text.begin(), text.end());
  }
  return out;
}

TEST(FlightRecord, OfARigWithFaults_ReplaysWithoutADifference) {
  const test::Finished played = test::Process({NODAL_BIN_DIR "/flight", (filmed().path / "000001").string()}).wait();
  EXPECT_EQ(played.code, 0) << played.out << played.err;
  EXPECT_NE(played.out.find("no difference"), std::string::npos) << played.out;
  const auto evidence = take::read_evidence(bytes_of(filmed().path / "000001" / "evidence-0000"), "evidence-0000");
  ASSERT_TRUE(evidence) << evidence.error().text();
  EXPECT_FALSE(evidence->seams.empty()) << "they are in the evidence, and of no importance to capture";
}

TEST(FlightRecord, WithOneGenlockConstantChanged_TheFirstDifferenceIsNamed) {
  const test::Finished played =
      test::Process({NODAL_BIN_DIR "/flight_canary", (filmed().path / "000001").string()}).wait();
  EXPECT_EQ(played.code, 1) << played.out << played.err;
  // 4 good sets in a row are required instead of 3, so the set that was the third is not locked now.
  EXPECT_NE(played.out.find("first difference: event "), std::string::npos) << played.out;
  const auto recorded = played.out.find("\n  recorded: set ");
  const auto now = played.out.find("\n  now:      set ");
  ASSERT_NE(recorded, std::string::npos) << played.out;
  ASSERT_NE(now, std::string::npos) << played.out;
  EXPECT_NE(played.out.find(", locked, ", recorded), std::string::npos) << played.out;
  EXPECT_NE(played.out.find(", acquiring, ", now), std::string::npos) << played.out;
}

TEST(FlightRecord, HoldsWhatBefellTheRig) {
  const Bytes bytes = bytes_of(filmed().path / "000001" / take::kFlightFile);
  auto reader = FlightReader::open(bytes, "flight");
  ASSERT_TRUE(reader) << reader.error().text();
  std::size_t gone = 0, commands = 0, refused = 0, pulses = 0, light = 0, orders = 0, sets = 0;
  std::map<firmware::LossReason, std::size_t> losses;
  for (;;) {
    const auto step = reader->next_step();
    ASSERT_TRUE(step) << step.error().text();
    if (step->empty()) break;
    for (const firmware::CaptureEvent& event : *step) {
      gone += std::holds_alternative<firmware::HeadFailed>(event);
      commands += std::holds_alternative<firmware::CommandTaken>(event);
      pulses += std::holds_alternative<firmware::PulseSeen>(event);
      light += std::holds_alternative<firmware::LightTaken>(event);
      sets += std::holds_alternative<firmware::SetClosed>(event);
      if (const auto* answer = std::get_if<firmware::CommandAnswered>(&event)) refused += !answer->status;
      if (const auto* lost = std::get_if<firmware::FramesLost>(&event)) ++losses[lost->reason];
      if (const auto* called = std::get_if<firmware::HeadCalled>(&event))
        orders += called->call == firmware::HeadCalled::Call::kExposure;
    }
  }
  EXPECT_EQ(reader->ended(), "the take ended");
  EXPECT_EQ(gone, 2U);
  EXPECT_GE(commands, 5U);
  EXPECT_EQ(refused, 1U);
  EXPECT_GT(pulses, 100U);
  EXPECT_GT(light, 100U);
  EXPECT_GT(orders, 20U) << "the exposure program follows the light";
  EXPECT_GT(sets, 100U);
  EXPECT_GE(losses.size(), 4U);
}

TEST(FlightRecord, CutAnywhere_PlaysUpToItsLastWholeStep) {
  const Bytes bytes = bytes_of(filmed().path / "000001" / take::kFlightFile);
  const Played whole = play(bytes);
  ASSERT_TRUE(whole.result);
  ASSERT_FALSE(*whole.result) << (*whole.result)->text();
  std::uint64_t before = 0;
  for (std::size_t part = 1; part < 16; ++part) {
    const Played cut = play(std::span(bytes).first(bytes.size() * part / 16 + part));
    ASSERT_TRUE(cut.result) << cut.result.error().text();
    EXPECT_FALSE(*cut.result) << (*cut.result)->text();
    EXPECT_EQ(cut.ended, "");
    EXPECT_GE(cut.steps, before);
    EXPECT_LT(cut.steps, whole.steps);
    before = cut.steps;
  }
  EXPECT_GT(before, whole.steps / 2);
  const Played nothing = play(std::span(bytes).first(20));
  ASSERT_FALSE(nothing.result);
  EXPECT_EQ(nothing.result.error().code, Errc::kTruncated);
}

TEST(FlightRecord, WithOneEventChanged_ThatIsTheFirstDifference) {
  const Bytes bytes = bytes_of(filmed().path / "000001" / take::kFlightFile);
  int count = 0;
  // A pulse 2 ms later than it was: the sets of its neighbourhood are not as recorded.
  const Bytes later = edited(bytes, [&](take::flight::Record& record) {
    for (auto& event : *record.mutable_events()) {
      if (event.has_pulse() && ++count == 60) event.mutable_pulse()->set_at_ns(event.pulse().at_ns() - 2'000'000);
    }
  });
  const Played moved = play(later);
  ASSERT_TRUE(moved.result && *moved.result);
  EXPECT_TRUE((*moved.result)->place == "sets" || (*moved.result)->place == "genlock") << (*moved.result)->text();
  // An exposure that is requested otherwise than recorded.
  count = 0;
  const Played other = play(edited(bytes, [&](take::flight::Record& record) {
    for (auto& event : *record.mutable_events()) {
      if (event.has_called() && event.called().call() == 2 && ++count == 8)
        event.mutable_called()->set_value(event.called().value() + 1000);
    }
  }));
  ASSERT_TRUE(other.result && *other.result);
  EXPECT_TRUE((*other.result)->place.starts_with("head cam")) << (*other.result)->text();
  EXPECT_NE((*other.result)->recorded.find("gets an exposure of "), std::string::npos) << (*other.result)->text();
}

/// Bytes of a few records changed, with right checksums: values at their ends, other events, other heads, times that
/// fall.
TEST(FlightRecord, WithBytesChanged_IsPlayedOrRefusedAndNeverEndsTheProgram) {
  const Bytes good = bytes_of(filmed().path / "000001" / take::kFlightFile);
  int refused = 0, different = 0;
  for (std::uint32_t seed = 0; seed < 500; ++seed) {
    std::mt19937 random(seed);
    const Bytes bytes = edited(good, [&](take::flight::Record& record) {
      if (random() % 150 != 0 || record.events_size() == 0) return;
      auto& event = *record.mutable_events(static_cast<int>(random() % static_cast<unsigned>(record.events_size())));
      std::string stored = event.SerializeAsString();
      for (unsigned k = 0; k <= random() % 3 && !stored.empty(); ++k)
        stored[random() % stored.size()] = static_cast<char>(random() % 2 == 0 ? 0xff : random());
      take::flight::Event changed;
      if (changed.ParseFromString(stored)) event = changed;
    });
    const Played played = play(bytes);
    refused += !played.result;
    different += played.result && *played.result;
  }
  EXPECT_GT(refused, 10);
  EXPECT_GT(different, 10);
}

TEST(FlightRecord, ThatIsHostile_IsRefusedWithItsRecord) {
  const Bytes good = bytes_of(filmed().path / "000001" / take::kFlightFile);
  const auto refused = [&](const char* reason, const std::function<void(take::flight::Record&)>& edit) {
    SCOPED_TRACE(reason);
    const Bytes bytes = edited(good, edit);
    auto reader = FlightReader::open(bytes, "take/flight");
    Error error = reader ? Error() : reader.error();
    while (reader) {
      const auto step = reader->next_step();
      if (!step) error = step.error();
      if (!step || step->empty()) break;
    }
    EXPECT_TRUE(error.message.starts_with("take/flight: ")) << error.message;
    EXPECT_NE(error.message.find(reason), std::string::npos) << error.message;
  };
  const auto events = [](auto change) {
    return [change](take::flight::Record& record) {
      for (auto& event : *record.mutable_events()) change(event);
    };
  };
  refused("has one begin", [](take::flight::Record& record) { record.clear_begin(); });
  refused("is newer than this program", [](take::flight::Record& record) {
    if (record.has_begin()) record.mutable_begin()->set_version(2);
  });
  refused("1000000 sets held", [](take::flight::Record& record) {
    if (record.has_begin()) record.mutable_begin()->set_sets_held(1'000'000);
  });
  refused("the head is out of range", events([](take::flight::Event& event) {
            if (event.has_delivered()) event.mutable_delivered()->set_head(16);
          }));
  refused("the picture is out of range", events([](take::flight::Event& event) {
            if (event.has_delivered() && event.delivered().has_picture())
              event.mutable_delivered()->mutable_picture()->set_format(77);
          }));
  refused("the time of a step is out of range", events([](take::flight::Event& event) {
            if (event.has_step_ns()) event.set_step_ns(-1);
          }));
  refused("the time of a step is out of range", events([](take::flight::Event& event) {
            if (event.has_step_ns()) event.set_step_ns(INT64_MAX / 4);
          }));
  refused("the rate of the command is out of range", events([](take::flight::Event& event) {
            if (event.has_command()) event.mutable_command()->mutable_genlock_start()->set_rate_numerator(1);
          }));
  refused("an event of an unknown kind", events([](take::flight::Event& event) { event.clear_what(); }));
  refused("an event before the first step", events([](take::flight::Event& event) {
            if (event.has_step_ns()) event.set_trigger_stopped(true);
          }));
  refused("a step with more than 4096 events",
          events([once = std::make_shared<bool>(false)](take::flight::Event& event) {
            if (event.has_step_ns() && std::exchange(*once, true)) event.set_trigger_stopped(true);
          }));
}

}  // namespace
}  // namespace nodal::flight
