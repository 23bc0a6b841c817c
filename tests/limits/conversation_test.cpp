// Rows of "A conversation, at either end", and what the hosts of a rig cost together.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "firmware/hosts/admission.h"
#include "firmware/hosts/control.h"
#include "heap.h"
#include "protocol/session.h"
#include "protocol/ssh_signature.h"
#include "protocol/upload.h"
#include "rows.h"
#include "tests/support/limits_page.h"

namespace nodal::limits {
namespace {

using firmware::Admission;
using firmware::Control;
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kHosts = Admission::in_all(Admission::kMaxClients);
constexpr std::size_t kLinks = Admission::in_all(Admission::kMaxLinks);

/// All that a session has to write.
Bytes output_of(Session& session) {
  Bytes bytes;
  for (auto out = session.output(); !out.empty(); out = session.output()) {
    bytes.insert(bytes.end(), out.begin(), out.end());
    session.sent(out.size());
  }
  return bytes;
}

/// The greeting with the largest message that may be one: features without a letter need most memory for a byte.
wire::Hello largest_hello() {
  wire::Hello hello = make_hello("a test");
  while (hello.ByteSizeLong() + 2 <= kMaxMessageBytes) hello.add_features();
  return hello;
}

/// A frame of this type without its last byte.
Bytes incomplete(FrameType type, std::uint32_t sequence) {
  const Bytes payload(max_payload_bytes(type), 1);
  const std::uint32_t stream = type == FrameType::kBulk ? 1 : 0;
  const auto header = encode_frame_header(FrameHeader{type, 0, stream, sequence}, payload);
  Bytes frame(header.size() + payload.size() - 1, 1);
  std::ranges::copy(header, frame.begin());
  return frame;
}

std::uint64_t of_an_incomplete_frame(Role role, FrameType type) {
  const Bytes frame = incomplete(type, 0);
  return peak_of([&] {
    Session session(role, make_hello("a test"));
    ASSERT_TRUE(session.receive(frame));
  });
}

/// Replies whose memory is largest for their bytes: lists of elements without a field.
wire::Reply reply_of_empty_elements() {
  wire::Reply reply;
  while (reply.heads().heads_size() < static_cast<int>(kMaxListReplyBytes / 2 - 16)) reply.mutable_heads()->add_heads();
  return reply;
}

/// Requests whose memory is largest for their bytes: small numbers. Their frames, until a rig has its events full.
std::vector<Bytes> requests_until_full() {
  Session host(Role::kHost, make_hello("a test"));
  wire::Request request;
  while (request.ByteSizeLong() + 8 < kMaxRequestBytes) {
    for (int k = 0; k < 4; ++k) request.mutable_head_set()->add_heads(1);
  }
  std::vector<Bytes> frames{output_of(host)};
  for (std::size_t bytes = 0; bytes < kMaxRigEventQueueBytes; bytes += kMaxRequestBytes) {
    EXPECT_TRUE(host.send(request));
    frames.push_back(output_of(host));
  }
  return frames;
}

std::uint64_t of_events(Role role, const std::vector<Bytes>& frames) {
  return peak_of([&] {
    Session session(role, make_hello("a test"));
    for (const Bytes& frame : frames) {
      if (!session.wants_input()) break;
      ASSERT_TRUE(session.receive(frame));
    }
    EXPECT_FALSE(session.wants_input());
  });
}

/// Pieces of items, which a host has on several streams.
std::vector<Bytes> pieces_until_full() {
  Session rig(Role::kRig, make_hello("a test"));
  Session host(Role::kHost, make_hello("a test"));
  EXPECT_TRUE(rig.receive(output_of(host)));
  std::vector<Bytes> frames{output_of(rig)};
  EXPECT_TRUE(host.receive(frames.back()));
  const auto body = std::make_shared<const Bytes>(kHostLosslessWindowBytes);
  while (host.wants_input()) {
    const auto stream = rig.open_stream(StreamPolicy::kLossless);
    EXPECT_TRUE(stream && rig.offer(*stream, BulkItem{"", SharedBytes(body)}));
    frames.push_back(output_of(rig));
    EXPECT_TRUE(host.receive(frames.back()));
    EXPECT_TRUE(rig.receive(output_of(host)));  // credits
    frames.push_back(output_of(rig));
    if (!host.wants_input()) break;
    EXPECT_TRUE(host.receive(frames.back()));
  }
  return frames;
}

std::uint64_t of_replies(Role role) {
  wire::Reply reply;
  reply.mutable_calibration()->set_json(std::string(kMaxCalibrationBytes, ' '));
  wire::Request request;
  request.mutable_calibration_get()->set_id(std::string(kMaxRequestBytes - 64, 'x'));
  return peak_of([&] {
    Session session(role, make_hello("a test"));
    if (role == Role::kRig) {
      while (session.send(reply)) {}
      reply.mutable_calibration()->set_json("");
      while (session.send(reply)) {}
    } else {
      while (session.send(request)) {}
    }
  });
}

std::uint64_t of_streams() {
  Session rig(Role::kRig, make_hello("a test")), host(Role::kHost, make_hello("a test"));
  EXPECT_TRUE(rig.receive(output_of(host)) && host.receive(output_of(rig)));
  return peak_of([&] {
    for (std::size_t k = 0; k < kMaxStreams; ++k) {
      ASSERT_TRUE(rig.open_stream(StreamPolicy::kLatest) && host.open_stream(StreamPolicy::kLossless));
    }
    Bytes bytes = output_of(host);
    ASSERT_TRUE(rig.receive(bytes));
    while (rig.next_event()) {}
  });
}

std::uint64_t of_an_error() {
  wire::Error error;
  error.set_message(std::string(kMaxMessageBytes - 16, 'x'));
  const std::string payload = error.SerializeAsString();
  const std::span said(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
  const auto header = encode_frame_header(FrameHeader{FrameType::kBye, 0, 0, 0}, said);
  Bytes frame(header.size() + said.size());
  std::ranges::copy(header, frame.begin());
  std::ranges::copy(said, frame.begin() + header.size());
  return peak_of([&] {
    Session session(Role::kHost, make_hello("a test"));
    EXPECT_FALSE(session.receive(frame));
  });
}

TEST(LimitsOfMemory, OfAConversation_AreThoseOnThePage) {
  const wire::Reply lists = reply_of_empty_elements();
  check({
      {"an incomplete frame at a rig, by type", Means::kHeap,
       [] { return of_an_incomplete_frame(Role::kRig, FrameType::kRequest); }},
      {"an incomplete frame at a host, by type", Means::kHeap,
       [] { return of_an_incomplete_frame(Role::kHost, FrameType::kReply); }},
      {"events not yet taken at a rig: requests, pieces", Means::kHeap,
       [] { return of_events(Role::kRig, requests_until_full()); }},
      {"events not yet taken at a host: replies, pieces", Means::kHeap,
       [] { return of_events(Role::kHost, pieces_until_full()); }},
      {"replies not yet written", Means::kHeap, [] { return of_replies(Role::kRig); }},
      {"requests not yet written", Means::kHeap, [] { return of_replies(Role::kHost); }},
      {"open streams, per direction", Means::kHeap, of_streams},
      {"lists in a reply, on a host", Means::kHeap,
       [&] {
         Session rig(Role::kRig, make_hello("a test"));
         EXPECT_TRUE(rig.send(lists));
         const Bytes bytes = output_of(rig);
         return peak_of([&] {
           Session host(Role::kHost, make_hello("a test"));
           EXPECT_TRUE(host.receive(bytes));
         });
       }},
      {"text of an error that a peer sends", Means::kHeap, of_an_error},
  });
}

/// A link whose host has said what costs most, and half a frame.
std::uint64_t of_all_links() {
  Bytes bytes;
  {
    Session host(Role::kHost, largest_hello());
    bytes = output_of(host);
    const Bytes half = incomplete(FrameType::kRequest, 1);
    bytes.insert(bytes.end(), half.begin(), half.end());
  }
  return peak_of([&] {
    std::vector<std::unique_ptr<Session>> links;
    for (std::size_t k = 0; k < kLinks; ++k) {
      links.push_back(std::make_unique<Session>(Role::kRig, make_hello("a test")));
      ASSERT_TRUE(links.back()->receive(bytes));
    }
  });
}

std::uint64_t of_uploads(std::size_t owners) {
  constexpr std::size_t kOfOne = Control::kUploadsOfAClient;
  const Bytes part(kMaxPieceBytes);
  return peak_of([&] {
    UploadReceiver receiver({kMaxCalibrationBytes, kOfOne * Admission::kMaxClients, kOfOne});
    for (std::size_t k = 0; k < owners * kOfOne; ++k) {
      Sha256 name{};
      name[0] = static_cast<std::uint8_t>(k);
      ASSERT_TRUE(receiver.begin(name, kMaxCalibrationBytes, 1 + k / kOfOne));
      for (std::size_t at = 0; at + part.size() < kMaxCalibrationBytes; at += part.size())
        ASSERT_TRUE(receiver.write(name, at, part));
    }
  });
}

TEST(LimitsOfMemory, OfTheHostsOfARig_AreThoseOnThePage) {
  check({
      {"all links", Means::kHeap, of_all_links},
      {"incomplete uploads", Means::kHeap, [] { return of_uploads(1); }},
      {"the same, of all hosts", Means::kHeap, [] { return of_uploads(Admission::kMaxClients); }},
      {"a calibration's signature", Means::kSizes, [] { return kMaxSignatureBytes; }},
  });
}

// A board has 512 MiB, of which the system, the program and its pictures need a part.
TEST(LimitsOfMemory, OfAllHostsThatReadNothingAndAskForTheMost_LeaveRoomOnASmallBoard) {
  const auto bytes_of = [](const char* what) {
    const auto figure = test::figure_on_page(NODAL_SOURCE_DIR, what);
    EXPECT_TRUE(figure) << what;
    return figure ? figure->bytes : 0;
  };
  const std::uint64_t all = kHosts * (bytes_of("events not yet taken at a rig: requests, pieces") +
                                      bytes_of("replies not yet written") + bytes_of("open streams, per direction")) +
                            bytes_of("all links") + bytes_of("the same, of all hosts");
  EXPECT_LE(all, std::uint64_t{192} << 20);
}

}  // namespace
}  // namespace nodal::limits
