// Writes the seeds of the framing and session targets into corpus/: real conversations, and short revealing ones. Run
// it again after the protocol changed: fuzz_seeds_protocol tests/fuzz/corpus
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/bytes.h"
#include "protocol/session.h"

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
  write(corpus / "upload/whole", Bytes{0, 2, 0, 0, 1, 2, 0, 40, 0, 2, 0, 0, 1, 2, 40, 37, 3, 2, 0, 0});
  write(corpus / "upload/liar",
        Bytes{0, 3, 0, 0, 2, 3, 0, 100, 1, 3, 100, 100, 3, 3, 0, 0, 0, 3, 0, 0, 1, 3, 0, 200, 3, 3, 0, 0});
  write(corpus / "upload/crowd", Bytes{0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4,
                                       0, 0, 1, 1, 0, 1, 3, 1, 0, 0, 3, 0, 0, 0, 4, 2, 0, 0});
  return 0;
}
