// Writes the seeds of the framing, session and take targets into corpus/: real conversations, and short revealing ones.
// Run it again after the protocol changed: fuzz_seeds_protocol tests/fuzz/corpus
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/bytes.h"
#include "protocol/session.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "protocol/take/flight.pb.h"
#include "protocol/take/seam_map.h"

namespace nodal {
namespace {

using Bytes = std::vector<std::uint8_t>;

void write(const std::filesystem::path& file, const Bytes& bytes) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// The bytes of both ends of one conversation that uses every kind of frame.
struct Talk {
  Session host{Role::kHost, make_hello("nodal 0.1.0")};
  Session rig{Role::kRig, make_hello("nodald 0.1.0")};
  Bytes from_host, from_rig;

  void move(Session& from, Session& to, Bytes& log) {
    for (auto out = from.output(); !out.empty(); out = from.output()) {
      log.insert(log.end(), out.begin(), out.end());
      (void)to.receive(out);
      from.sent(out.size());
    }
    while (to.next_event()) {}
  }
  void run() {
    for (int i = 0; i < 6; ++i) {
      move(host, rig, from_host);
      move(rig, host, from_rig);
    }
  }
};

void converse(Talk& talk) {
  wire::Request request;
  request.set_id(1);
  request.mutable_head_set()->set_exposure_ns(8'000'000);
  (void)talk.host.send(request);
  wire::Reply reply;
  reply.set_id(1);
  reply.mutable_done();
  (void)talk.rig.send(reply);
  talk.run();
  const auto body = std::make_shared<const Bytes>(300, std::uint8_t{9});
  const StreamId live = talk.rig.open_stream(StreamPolicy::kLatest).value();
  const StreamId upload = talk.host.open_stream(StreamPolicy::kLossless).value();
  for (int i = 0; i < 3; ++i) (void)talk.rig.offer(live, BulkItem{"raymap", body, 0});
  (void)talk.host.offer(upload, BulkItem{"part", body, 100});
  (void)talk.host.offer(upload, BulkItem{"", {}, 0});
  talk.run();
  (void)talk.rig.offer(live, BulkItem{"raymap", body, 0});
  talk.host.stop_stream(live, Error{Errc::kCancelled, "enough"});
  talk.host.close_stream(upload);
  talk.run();
  talk.host.close(Error{Errc::kCancelled, "done"});
  talk.run();
}

/// A byte stream in the session target's format: (type, stream, length, payload) for each frame.
Bytes as_operations(std::uint8_t role, std::span<const std::uint8_t> stream) {
  Bytes operations{role};
  FrameDecoder decoder;
  while (true) {
    const auto frame = decoder.next(stream);
    if (!frame || !*frame) return operations;
    const auto& [header, payload] = **frame;
    const std::uint8_t head[] = {static_cast<std::uint8_t>(header.type), static_cast<std::uint8_t>(header.stream),
                                 static_cast<std::uint8_t>(payload.size() & 0xFF),
                                 static_cast<std::uint8_t>(payload.size() >> 8)};
    operations.insert(operations.end(), std::begin(head), std::end(head));
    operations.insert(operations.end(), payload.begin(), payload.end());
  }
}

template <class Record>
void add_record(Bytes& to, const Record& record) {
  const std::string bytes = record.SerializeAsString();
  to.push_back(static_cast<std::uint8_t>(bytes.size() & 0xFF));
  to.push_back(static_cast<std::uint8_t>(bytes.size() >> 8));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// The flight records of a head that is opened, started and delivers, of a pulse, a command, a set and an end.
Bytes flight_records() {
  Bytes all;
  take::flight::Record first;
  first.mutable_begin()->set_version(1);
  first.mutable_begin()->set_sets_held(8);
  first.mutable_begin()->set_trigger(true);
  first.add_events()->set_step_ns(1'000'000);
  take::flight::Opened& opened = *first.add_events()->mutable_opened();
  opened.set_path("sim:a");
  opened.set_format(2);
  opened.set_width(16);
  opened.set_height(8);
  opened.set_rate_numerator(30);
  opened.set_rate_denominator(1);
  first.add_events()->mutable_called()->set_call(0);
  take::flight::TriggerStarted& trigger = *first.add_events()->mutable_trigger_started();
  trigger.set_rate_numerator(30);
  trigger.set_rate_denominator(1);
  for (int head = 0; head < kMaxHeads; ++head) trigger.add_delay_ns(0);
  add_record(all, first);
  take::flight::Record second;
  second.add_events()->set_step_ns(2'000'000);
  second.add_events()->mutable_pulse()->set_number(1);
  take::flight::Delivered& delivered = *second.add_events()->mutable_delivered();
  delivered.mutable_settings()->set_exposure_ns(1'000'000);
  delivered.mutable_picture()->set_format(2);
  delivered.mutable_picture()->set_present(true);
  second.add_events()->mutable_command()->mutable_heads()->set_exposure_ns(5);
  second.add_events()->mutable_answer()->mutable_status()->set_code(103);
  take::flight::SetClosed& set = *second.add_events()->mutable_set_closed();
  set.set_mask(1);
  set.add_offset_ns(7);
  second.add_events()->mutable_set_returned()->set_collection(1);
  second.add_events()->mutable_lost()->set_reason(2);
  second.add_events()->set_genlock(2);
  second.add_events()->set_step_ns(3'000'000);
  second.mutable_end()->set_reason("the take ended");
  add_record(all, second);
  return all;
}

/// The records of a short segment of three heads, one of which is missing in the second set, and of raymaps.
Bytes take_records() {
  constexpr std::uint64_t kHead = 1024, kPicture = 16 * 8;
  Bytes all;
  take::wire::Record begin;
  begin.mutable_begin()->set_version(take::kEvidenceVersion);
  for (std::uint32_t k = 0; k < 4; ++k) {
    take::wire::File& file = *begin.mutable_begin()->add_files();
    file.set_name(k < 3 ? take::head_file(k, 0) : take::raymap_file(0));
    if (k < 3) file.set_head(k);
    file.set_format(k < 2 ? "GREY" : "MJPEG");
    file.set_width(16);
    file.set_height(8);
    file.set_fields(k == 1 ? "top-first" : "progressive");
    file.set_head_bytes(kHead);
  }
  add_record(all, begin);
  for (std::uint64_t i = 0; i < 2; ++i) {
    take::wire::Record set;
    set.mutable_set()->set_index(i);
    set.mutable_set()->set_number(7 + i);
    set.mutable_set()->set_mid_exposure_ns(static_cast<std::int64_t>(1'000'000'000 + 40'000'000 * i));
    set.mutable_set()->set_since_start_ns(static_cast<std::int64_t>(40'000'000 * i));
    set.mutable_set()->set_genlock("locked");
    for (std::uint32_t k = 0; k < 3; ++k) {
      take::wire::Frame& frame = *set.mutable_set()->add_frames();
      frame.set_file(k);
      frame.set_at(kHead + 40 + i * (kPicture + 10));
      frame.set_bytes(kPicture);
      frame.set_placeholder(i == 1 && k == 2 ? "missing" : "");
      frame.set_exposure_ns(8'000'000);
    }
    add_record(all, set);
  }
  take::wire::Record clusters;
  clusters.mutable_clusters()->set_sets(2);
  for (int k = 0; k < 4; ++k) {
    clusters.mutable_clusters()->add_end(kHead + 400);
    clusters.mutable_clusters()->add_hashes("");
  }
  add_record(all, clusters);
  take::wire::Record calibration;
  calibration.mutable_calibration()->set_file(take::calibration_file(1));
  calibration.mutable_calibration()->set_id(std::string(64, 'a'));
  calibration.mutable_calibration()->set_set(8);
  add_record(all, calibration);
  Bytes labels(8 * 4, take::kNoHeadOfSeams);
  for (std::size_t k = 0; k < 20; ++k) labels[k] = k < 17 ? 0 : 2;
  take::wire::Record seams;
  *seams.mutable_seams() = take::seams_record(8, 8, labels);
  add_record(all, seams);
  take::wire::Record mark;
  mark.mutable_mark()->set_set(1);
  mark.mutable_mark()->set_text("bus");
  add_record(all, mark);
  take::wire::Record end;
  end.mutable_end()->set_sets(2);
  end.mutable_end()->set_reason("stopped");
  for (int k = 0; k < 4; ++k) {
    end.mutable_end()->add_length(kHead + 500);
    end.mutable_end()->add_hashes("");
  }
  add_record(all, end);
  return all;
}

Bytes text(const std::string& words) { return {words.begin(), words.end()}; }

Bytes with_front(std::uint8_t front, const Bytes& rest) {
  Bytes all{front};
  all.insert(all.end(), rest.begin(), rest.end());
  return all;
}

}  // namespace
}  // namespace nodal

int main(int argc, char** argv) {
  using namespace nodal;
  if (argc != 2) {
    std::fprintf(stderr, "fuzz_seeds_protocol CORPUS_FOLDER\n");
    return 2;
  }
  const std::filesystem::path corpus = argv[1];
  auto talk = std::make_unique<Talk>();
  converse(*talk);
  write(corpus / "framing/host_as_it_is", with_front(0, talk->from_host));
  write(corpus / "framing/rig_as_it_is", with_front(2, talk->from_rig));
  write(corpus / "framing/host_put_right", with_front(1, talk->from_host));
  write(corpus / "framing/rig_put_right", with_front(3, talk->from_rig));
  write(corpus / "framing/half_a_header", with_front(0, Bytes(talk->from_host.begin(), talk->from_host.begin() + 20)));
  write(corpus / "framing/not_nodal", with_front(0, text("GET / HTTP/1.1\r\nHost: x\r\n\r\n")));
  const Bytes at_rig = as_operations(0, talk->from_host);
  const Bytes at_host = as_operations(1, talk->from_rig);
  write(corpus / "session/at_rig", at_rig);
  write(corpus / "session/at_host", at_host);
  // With actions of the program: opens both kinds, offers, gets a credit, does not read, stops, closes.
  Bytes acting = as_operations(0, talk->from_host);
  acting.resize(1 + 4 + (acting[3] | acting[4] << 8));  // only the Hello
  const Bytes acts{0x80, 0,  0,  0, 0x81, 0,    0,    0,    0x82, 2, 1, 0, 'm',  0x82, 4,    0, 0,    0x82, 4,    0,
                   0,    18, 2,  3, 0,    0x08, 0xFF, 0x7F, 18,   4, 2, 0, 0x08, 0x7F, 0x86, 0, 0,    0,    0x87, 200,
                   0,    0,  16, 1, 2,    0,    0x08, 0x01, 0x85, 1, 0, 0, 0x83, 2,    0,    0, 0x84, 4,    0,    0};
  acting.insert(acting.end(), acts.begin(), acts.end());
  write(corpus / "session/program_acts", acting);
  write(corpus / "take/flight", with_front(3, flight_records()));
  write(corpus / "take/records", with_front(2, take_records()));
  take::TakeDocument about;
  about.number = 3;
  about.rig = "r";
  about.software = "s";
  about.mode = "jpeg";
  about.heads = {"a", "b"};
  write(corpus / "take/document", with_front(0, text(take::take_json(about))));
  take::Manifest manifest;
  manifest.number = 3;
  manifest.sets = 4;
  manifest.ended = "stopped";
  manifest.marks.push_back({2, "bus"});
  manifest.calibrations.push_back({take::calibration_file(1), std::string(64, 'a'), 8});
  manifest.files.push_back({"cam0-0000.mkv", 100, {}});
  write(corpus / "take/manifest", with_front(1, text(take::manifest_json(manifest))));
  write(corpus / "upload/whole", Bytes{0, 2, 0, 0, 1, 2, 0, 40, 0, 2, 0, 0, 1, 2, 40, 37, 3, 2, 0, 0});
  write(corpus / "upload/liar",
        Bytes{0, 3, 0, 0, 2, 3, 0, 100, 1, 3, 100, 100, 3, 3, 0, 0, 0, 3, 0, 0, 1, 3, 0, 200, 3, 3, 0, 0});
  write(corpus / "upload/crowd", Bytes{0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4,
                                       0, 0, 1, 1, 0, 1, 3, 1, 0, 0, 3, 0, 0, 0, 4, 2, 0, 0});
  return 0;
}
