// A rig with false messages cannot make `nodal` use much memory, hang, crash, or send control characters to a terminal.
#include "lying_rig.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <sstream>

#include "protocol/base/image.h"
#include "protocol/upload.h"
#include "rig_process.h"

namespace nodal::command_line {
namespace {

class ScriptedRig final : public LyingRig {
 public:
  using LyingRig::first_piece;
  using LyingRig::frame;
  using LyingRig::hello;
  using LyingRig::LyingRig;
  using LyingRig::open_stream;
  using LyingRig::reply;
  using LyingRig::reply_rate;
  using LyingRig::waiting;

  std::function<void(ScriptedRig&, const wire::Request&)> respond;

 private:
  void on(const wire::Request& request) override {
    if (respond) respond(*this, request);
  }
};

constexpr StreamId kStream = 2;  // the first stream that a rig opens

void start_pull(ScriptedRig& rig, const wire::Request& request, StreamId stream = kStream) {
  wire::Reply started;
  started.mutable_pull()->set_stream(stream);
  rig.open_stream(stream, StreamPolicy::kLossless);
  rig.reply(request, started);
}

std::uint64_t bytes_of(PixelFormat format, int width, int height) { return packed_size(format, width, height); }

class LyingRigs : public RigTest {
 protected:
  LyingRigs() : rig_(path("nodal.sock")) {}

  /// Runs `nodal WORDS` with 600 MB of address space against this rig. `timeout` is nodal's; long answers need the
  /// usual one on a busy machine.
  Finished against(std::function<void(ScriptedRig&, const wire::Request&)> respond, const std::string& words,
                   const std::string& timeout = "10s") {
    const bool of_genlock = words.starts_with("genlock");
    rig_.respond = [respond = std::move(respond), of_genlock](ScriptedRig& rig, const wire::Request& request) {
      if (request.has_genlock() && !of_genlock) return rig.reply_rate(request);
      respond(rig, request);
    };
#ifdef __SANITIZE_ADDRESS__
    const std::string limit;  // the sanitizer needs terabytes of address space
#else
    const std::string limit = "ulimit -v 600000; ";
#endif
    Process process({"sh", "-c", limit + "exec " NODAL_BIN_DIR "/nodal --timeout " + timeout + " " + words},
                    environment_);
    bool ended = false;
    const std::string stat = "/proc/" + std::to_string(process.pid()) + "/stat";
    (void)wait_until([&] {
      rig_.step();
      process.said();
      std::ifstream file(stat);
      const std::string line(std::istreambuf_iterator<char>(file), {});
      ended = line.find(") Z ") != std::string::npos;
      return ended;
    });
    return process.wait(std::chrono::seconds(1));
  }

  ScriptedRig rig_;
};

// --- what is announced, and not sent ---------------------------------------------------------------------

TEST_F(LyingRigs, RaymapLongerThanItsHeaderSays_IsRefusedBeforeAByteOfIt) {
  const auto respond = [](ScriptedRig& rig, const wire::Request& request) {
    if (!request.has_pull()) return;
    start_pull(rig, request);
    rig.first_piece(kStream, 0, raymap_meta(2048, 1024, "I420"), std::uint64_t{2} << 30, std::string(1000, 'x'));
  };
  const Finished run = against(respond, "raymap pull --format raw --out " + path("r.raw"));
  EXPECT_EQ(run.code, 4) << run.err;
  EXPECT_NE(run.err.find("the rig announced a raymap of 2"), std::string::npos) << run.err;
}

TEST_F(LyingRigs, LargestRaymapAnnouncedAndNotSent_TakesNoMemory) {
  const auto respond = [](ScriptedRig& rig, const wire::Request& request) {
    if (!request.has_pull()) return;
    start_pull(rig, request);
    rig.first_piece(kStream, 0, raymap_meta(16384, 8192, "RGB48"), bytes_of(PixelFormat::kRgb48, 16384, 8192),
                    std::string(1000, 'x'));
  };
  const Finished run = against(respond, "raymap pull --format raw --out " + path("r.raw"), "500ms");
  EXPECT_EQ(run.code, 3) << run.err;
  EXPECT_NE(run.err.find("the rig has sent nothing for"), std::string::npos) << run.err;
}

TEST_F(LyingRigs, RaymapOfACodingNobodyAskedFor_IsRefused) {
  const auto respond = [](ScriptedRig& rig, const wire::Request& request) {
    if (!request.has_pull()) return;
    start_pull(rig, request);
    rig.first_piece(kStream, 0, raymap_meta(16384, 8192, "RGB48"), 10, std::string(10, 'x'));
  };
  const Finished run = against(respond, "raymap pull --out " + path("r.jpg"));
  EXPECT_EQ(run.code, 4) << run.err;
  EXPECT_NE(run.err.find("which was not asked for"), std::string::npos) << run.err;
}

wire::FrameSetHeader frame_set_header(std::uint32_t side) {
  wire::FrameSetHeader header;
  for (int i = 0; i < 6; ++i) {
    wire::HeadPicture& head = *header.add_heads();
    head.set_name("cam" + std::to_string(i));
    head.set_format("RGB24");
    head.set_width(side);
    head.set_height(side);
    head.set_offset(std::uint64_t{3} * side * side * static_cast<std::uint64_t>(i));
  }
  return header;
}

void answer_calibration(ScriptedRig& rig, const wire::Request& request) {
  wire::Reply reply;
  reply.mutable_calibration()->set_json(to_json(six_heads("six")));
  rig.reply(request, reply);
}

TEST_F(LyingRigs, FrameSetAnnouncedAndNotSent_TakesNoMemory) {
  rig_.hello.add_features("frame-sets");
  const auto respond = [](ScriptedRig& rig, const wire::Request& request) {
    if (request.has_calibration_get()) answer_calibration(rig, request);
    if (!request.has_frame_set()) return;
    start_pull(rig, request);
    rig.first_piece(kStream, 0, frame_set_header(8000).SerializeAsString(), 1'000'000'000, std::string(1000, 'x'));
  };
  const Finished run = against(respond, "drift", "500ms");
  EXPECT_EQ(run.code, 3) << run.err;
  EXPECT_NE(run.err.find("timeout (303)"), std::string::npos) << run.err;
}

TEST_F(LyingRigs, SecondFrameSetOnItsStream_IsRefused) {
  rig_.hello.add_features("frame-sets");
  const auto respond = [](ScriptedRig& rig, const wire::Request& request) {
    if (request.has_calibration_get()) answer_calibration(rig, request);
    if (!request.has_frame_set()) return;
    start_pull(rig, request);
    for (std::uint64_t item = 0; item < 2; ++item) {
      rig.first_piece(kStream, item, frame_set_header(10).SerializeAsString(), 1800, std::string(1800, 'x'));
    }
  };
  const Finished run = against(respond, "drift");
  EXPECT_EQ(run.code, 3) << run.err;
  EXPECT_NE(run.err.find("second frame set"), std::string::npos) << run.err;
}

TEST_F(LyingRigs, FrameSetThatLacksAHead_IsPassedOver) {
  rig_.hello.add_features("frame-sets");
  int sets = 0;
  const auto respond = [&](ScriptedRig& rig, const wire::Request& request) {
    if (request.has_calibration_get()) answer_calibration(rig, request);
    if (!request.has_frame_set()) return;
    const auto stream = static_cast<StreamId>(kStream + 2 * sets);
    wire::FrameSetHeader header = frame_set_header(10);
    header.set_calibration_id(sha256_to_wire(calibration_id(six_heads("six"))));
    if (sets++ == 0) header.mutable_heads()->DeleteSubrange(5, 1);
    const std::string pictures(static_cast<std::size_t>(300 * header.heads_size()), 'x');
    start_pull(rig, request, stream);
    rig.first_piece(stream, 0, header.SerializeAsString(), pictures.size(), pictures);
    rig.frame(FrameType::kStreamClose, stream, "\x08\x01");  // a wire::StreamClose: one item was offered
  };
  const Finished run = against(respond, "drift --sets 1");
  EXPECT_EQ(run.code, 4) << run.err;
  EXPECT_NE(run.err.find("the picture is 10x10"), std::string::npos) << "the second set is used: " << run.err;
}

// --- lists -----------------------------------------------------------------------------------------------

TEST_F(LyingRigs, MegabyteOfEmptyHeads_IsRefusedBeforeItIsRead) {
  const auto respond = [](ScriptedRig& rig, const wire::Request& request) {
    if (!request.has_heads()) return;
    wire::Reply reply;
    for (int i = 0; i < 500'000; ++i) reply.mutable_heads()->add_heads();
    rig.reply(request, reply);
  };
  const Finished run = against(respond, "heads");
  EXPECT_EQ(run.code, 4) << run.err;
  EXPECT_NE(run.err.find("that is not a calibration"), std::string::npos) << run.err;
}

TEST_F(LyingRigs, ListsOverTheirLimits_AreRefused) {
  struct Case {
    const char* words;
    const char* what;
    std::function<void(wire::Reply&)> fill;
  };
  const std::vector<Case> cases{
      {"heads", "17 heads",
       [](wire::Reply& r) {
         for (int i = 0; i < 17; ++i) r.mutable_heads()->add_heads();
       }},
      {"heads", "losses of a head",
       [](wire::Reply& r) {
         wire::HeadState& head = *r.mutable_heads()->add_heads();
         for (int i = 0; i < 1000; ++i) head.add_losses();
       }},
      {"exposure show", "heads",
       [](wire::Reply& r) {
         for (int i = 0; i < 17; ++i) r.mutable_exposure()->add_heads();
       }},
      {"status", "marks",
       [](wire::Reply& r) {
         for (int i = 0; i < 9000; ++i) r.mutable_status()->add_marks();
       }},
      {"status", "losses",
       [](wire::Reply& r) {
         for (int i = 0; i < 9000; ++i) r.mutable_status()->add_losses();
       }},
      {"status", "SHA-256|id of 5 bytes", [](wire::Reply& r) { r.mutable_status()->set_calibration_id("12345"); }},
      {"genlock show", "aligned",
       [](wire::Reply& r) {
         for (int i = 0; i < 9000; ++i) r.mutable_genlock()->add_unaligned();
       }},
      {"hosts", "hosts",
       [](wire::Reply& r) {
         for (int i = 0; i < 9000; ++i) r.mutable_hosts()->add_hosts();
       }},
      {"heads scan", "lines about devices",
       [](wire::Reply& r) {
         for (int i = 0; i < 9000; ++i) r.mutable_devices()->add_lines();
       }},
      {"heads scan --json", "no JSON object", [](wire::Reply& r) { r.mutable_devices()->set_json("[1, 2"); }},
      {"heads scan --json", "no JSON object",
       [](wire::Reply& r) { r.mutable_devices()->set_json(std::string(300'000, '[')); }},
      {"audit", "changes",
       [](wire::Reply& r) {
         for (int i = 0; i < 9000; ++i) r.mutable_audit_log()->add_entries();
       }},
      {"calibration list", "calibrations",
       [](wire::Reply& r) {
         for (int i = 0; i < 9000; ++i) r.mutable_calibrations()->add_entries();
       }},
  };
  for (const Case& c : cases) {
    const auto respond = [&c](ScriptedRig& rig, const wire::Request& request) {
      wire::Reply reply;
      c.fill(reply);
      rig.reply(request, reply);
    };
    const Finished run = against(respond, c.words);
    EXPECT_EQ(run.code, 4) << c.words << ": " << run.err;
    const std::string what = c.what;
    EXPECT_NE(run.err.find(what.substr(what.find('|') + 1)), std::string::npos) << c.words << ": " << run.err;
  }
}

// --- what comes without being asked ----------------------------------------------------------------------

TEST_F(LyingRigs, StreamsWithoutEndInPlaceOfAnAnswer_EndWithinTheirWindows) {
  bool asked = false;
  const auto respond = [&asked](ScriptedRig& rig, const wire::Request&) {
    if (std::exchange(asked, true)) return;
    rig.open_stream(kStream, StreamPolicy::kLossless);
    for (std::uint64_t item = 0; item < 100; ++item) {  // 6 MB; at most 4 MiB may be in transit
      rig.first_piece(kStream, item, "", 60'000, std::string(60'000, 'x'));
    }
  };
  const Finished run = against(respond, "status");
  EXPECT_EQ(run.code, 3) << run.err;
  EXPECT_NE(run.err.find("more bytes came than there was credit for"), std::string::npos) << run.err;
}

TEST_F(LyingRigs, AnswersToNoQuestion_AreDropped) {
  const auto respond = [](ScriptedRig& rig, const wire::Request& request) {
    wire::Request other;
    for (std::uint64_t id = 1000; id < 1200; ++id) {
      other.set_id(id);
      wire::Reply junk;
      junk.mutable_status()->set_problem(std::string(10'000, 'x'));
      rig.reply(other, junk);
    }
    wire::Reply answer;
    answer.mutable_status()->set_state("running");
    rig.reply(request, answer);
  };
  const Finished run = against(respond, "--json status");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(Json::parse(run.out)["state"], "running");
}

TEST_F(LyingRigs, AnOlderRig_SaysThatItCannotListDevicesNorUndoTemporarySettings) {
  rig_.hello.add_features("frame-sets");
  const auto older = [](ScriptedRig& rig, const wire::Request& request) {
    wire::Reply reply;
    if (request.has_heads()) {
      wire::HeadState& head = *reply.mutable_heads()->add_heads();
      head.set_name("cam0");
      head.set_exposure_ns(8'000'000);
    } else if (request.has_genlock()) {
      reply.mutable_genlock()->set_rate_numerator(25);
      reply.mutable_genlock()->set_rate_denominator(1);
    } else if (request.has_head_set()) {
      reply.mutable_done();
    } else {
      reply.mutable_error()->set_code(static_cast<std::uint32_t>(Errc::kUnsupported));
      reply.mutable_error()->set_message("this rig (nodald 0.1.0) does not support that request");
    }
    rig.reply(request, reply);
  };
  const Finished latency = against(older, "heads latency cam0");
  EXPECT_NE(latency.code, 0);
  EXPECT_NE(latency.err.find("needs a newer nodald on the rig"), std::string::npos) << latency.err;
  const Finished scan = against(older, "heads scan");
  EXPECT_NE(scan.code, 0);
  EXPECT_NE(scan.err.find("does not support that request"), std::string::npos) << scan.err;
}

// --- text ------------------------------------------------------------------------------------------------

bool has_controls(const std::string& text) {
  return std::ranges::any_of(text,
                             [](char c) { return (static_cast<unsigned char>(c) < 0x20 && c != '\n') || c == 0x7F; });
}

TEST_F(LyingRigs, ControlCharactersInTexts_ReachNoTerminalAndKeepJsonWhole) {
  const std::string evil =
      "a\x1b[2J\nnodal: all is well\r\x07\x7F\xC2\x9B"
      "31m";
  rig_.hello.set_rig_name(evil);
  rig_.hello.set_software(evil);
  const auto respond = [&evil](ScriptedRig& rig, const wire::Request& request) {
    wire::Reply reply;
    if (request.has_status()) {
      wire::RigStatus& status = *reply.mutable_status();
      for (std::string* text : {status.mutable_state(), status.mutable_problem(), status.mutable_activity(),
                                status.mutable_calibration_name(), status.mutable_genlock()->mutable_state(),
                                status.mutable_genlock()->add_unaligned(), status.add_losses()->mutable_reason(),
                                status.add_publish_drops()->mutable_reason()}) {
        *text = evil;
      }
      status.set_calibration_id(std::string(32, 'x'));
      status.mutable_losses(0)->set_frames(1);
      status.mutable_publish_drops(0)->set_frames(1);
    } else if (request.has_heads()) {
      wire::HeadState& head = *reply.mutable_heads()->add_heads();
      for (std::string* text :
           {head.mutable_name(), head.mutable_path(), head.mutable_format(), head.mutable_problem()}) {
        *text = evil;
      }
    } else if (request.has_hosts()) {
      wire::HostState& host = *reply.mutable_hosts()->add_hosts();
      for (std::string* text : {host.mutable_peer(), host.mutable_software(), host.add_streams()}) *text = evil;
    } else if (request.has_devices()) {
      reply.mutable_devices()->add_lines(evil);
      reply.mutable_devices()->set_json(nlohmann::json{{evil, {evil, {{"a", evil}}}}, {"rig_toml", evil}}.dump());
    } else if (request.has_audit_log()) {
      wire::AuditEntry& entry = *reply.mutable_audit_log()->add_entries();
      for (std::string* text : {entry.mutable_who(), entry.mutable_what(), entry.mutable_before(),
                                entry.mutable_after(), entry.mutable_error()->mutable_message()}) {
        *text = evil;
      }
    } else if (request.has_calibration_list()) {
      reply.mutable_calibrations()->add_entries()->set_name(evil);
    } else {
      reply.mutable_error()->set_code(103);
      reply.mutable_error()->set_message(evil);
    }
    rig.reply(request, reply);
  };
  for (const std::string words :
       {"status", "status --watch --count 2 --interval 1ms", "heads", "calibration list", "genlock show",
        "exposure show", "hosts", "audit", "heads scan", "heads scan --json"}) {
    const Finished run = against(respond, words);
    EXPECT_FALSE(has_controls(run.out)) << words << ": " << run.out;
    EXPECT_FALSE(has_controls(run.err)) << words << ": " << run.err;
    EXPECT_EQ((run.out + run.err).find("\nnodal: all is well"), std::string::npos) << words;
    EXPECT_EQ((run.out + run.err).find("\xC2\x9B"), std::string::npos) << words;
    const Finished json = against(respond, "--json " + words);
    std::istringstream lines(json.out);
    for (std::string line; std::getline(lines, line);)
      EXPECT_FALSE(Json::parse(line, nullptr, false).is_discarded()) << line;
  }
}

}  // namespace
}  // namespace nodal::command_line
