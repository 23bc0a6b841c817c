#include "protocol/upload.h"

#include <gtest/gtest.h>

#include "conversation.h"

namespace nodal {
namespace {

std::span<const std::uint8_t> whole(const SharedBytes& bytes) { return *bytes; }

/// The firmware's handling of a host's messages: the receiver belongs to the rig, the rest to a session.
class RigSide {
 public:
  explicit RigSide(UploadReceiver& receiver) : receiver_(receiver) {}

  void handle(Session& session, const Event& event) {
    if (const auto* request = std::get_if<wire::Request>(&event)) {
      wire::Reply reply;
      reply.set_id(request->id());
      answer(*request, reply);
      (void)session.send(reply);
    } else if (const auto* piece = std::get_if<BulkPiece>(&event)) {
      if (const Status status = streams_[piece->stream].piece(*piece, receiver_); !status) {
        session.stop_stream(piece->stream, status.error());
      }
    }
  }

  std::vector<std::vector<std::uint8_t>> taken;

 private:
  void answer(const wire::Request& request, wire::Reply& reply) {
    const auto refuse = [&](const Error& error) {
      reply.mutable_error()->set_code(static_cast<std::uint32_t>(error.code));
      reply.mutable_error()->set_message(error.message);
    };
    if (request.has_upload_begin()) {
      const auto sha256 = sha256_from_wire(request.upload_begin().sha256());
      if (!sha256) return refuse(sha256.error());
      const auto offset = receiver_.begin(*sha256, request.upload_begin().length());
      if (!offset) return refuse(offset.error());
      reply.mutable_upload()->set_offset(*offset);
    } else {
      auto bytes = receiver_.take(sha256_from_wire(request.upload_commit().sha256()).value());
      if (!bytes) return refuse(bytes.error());
      taken.push_back(std::move(*bytes));
      reply.mutable_done();
    }
  }

  UploadReceiver& receiver_;
  std::map<StreamId, UploadStream> streams_;
};

/// The host tool's procedure: begin, send from the offset, commit after all bytes are sent.
class HostSide {
 public:
  explicit HostSide(SharedBytes document) : sender_(std::move(document)) {}

  void start(Session& session) {
    wire::Request request;
    request.set_id(1);
    *request.mutable_upload_begin() = sender_.begin();
    (void)session.send(request);
  }
  void handle(Session& session, const Event& event) {
    const auto* reply = std::get_if<wire::Reply>(&event);
    if (reply == nullptr) return;
    if (reply->has_error()) {
      error = Error{static_cast<Errc>(reply->error().code()), reply->error().message()};
    } else if (reply->has_upload()) {
      went_on_from = reply->upload().offset();
      stream_ = session.open_stream(StreamPolicy::kLossless).value();
      (void)session.offer(stream_, sender_.item(*went_on_from).value());
    } else {
      done = true;
    }
  }
  void step(Session& session) {
    if (stream_ == 0 || committed_ || session.counts(stream_)->pending > 0) return;
    wire::Request request;
    request.set_id(2);
    *request.mutable_upload_commit() = sender_.commit();
    committed_ = session.send(request).has_value();
  }

  std::optional<std::uint64_t> went_on_from;
  bool done = false;
  std::optional<Error> error;

 private:
  UploadSender sender_;
  StreamId stream_ = 0;
  bool committed_ = false;
};

/// Moves bytes between host and rig until neither has output, or the link drops after `budget` bytes to the rig.
void talk_until(HostSide& host, RigSide& rig, std::size_t budget) {
  Session at_host(Role::kHost, make_hello("host"));
  Session at_rig(Role::kRig, make_hello("rig"));
  host.start(at_host);
  for (bool moved = true; moved;) {
    moved = false;
    for (auto out = at_host.output(); !out.empty(); out = at_host.output()) {
      const auto part = out.first(std::min(out.size(), budget));
      ASSERT_TRUE(at_rig.receive(part));
      at_host.sent(part.size());
      budget -= part.size();
      for (const Event& event : take_events(at_rig)) rig.handle(at_rig, event);
      if (budget == 0) return;
      moved = true;
    }
    const auto back = take_output(at_rig);
    moved = moved || !back.empty();
    ASSERT_TRUE(at_host.receive(back));
    for (const Event& event : take_events(at_host)) host.handle(at_host, event);
    host.step(at_host);
  }
}

TEST(Upload, LinkCutAtEveryByte_ResumedAndIdentical) {
  const auto document = shared_bytes(200);
  std::size_t resumed_inside = 0;
  for (std::size_t cut = 1;; ++cut) {
    UploadReceiver receiver;
    RigSide rig(receiver);
    HostSide first(document);
    ASSERT_NO_FATAL_FAILURE(talk_until(first, rig, cut));
    if (first.done) break;             // the cut came after the last byte
    if (!rig.taken.empty()) continue;  // the answer was lost, but not the document
    RigSide rig_again(receiver);       // the session's streams are gone, the receiver is not
    HostSide second(document);
    ASSERT_NO_FATAL_FAILURE(talk_until(second, rig_again, SIZE_MAX));
    ASSERT_TRUE(second.done) << cut;
    ASSERT_EQ(rig_again.taken.size(), 1u);
    ASSERT_EQ(rig_again.taken[0], *document);
    if (*second.went_on_from > 0) ++resumed_inside;
  }
  EXPECT_GT(resumed_inside, 0u);
}

TEST(Upload, LongDocumentCutInItsMiddle_GoesOnFromThePieceThatArrived) {
  const auto document = shared_bytes(1'000'000);
  UploadReceiver receiver;
  RigSide rig(receiver);
  HostSide first(document);
  ASSERT_NO_FATAL_FAILURE(talk_until(first, rig, 500'000));
  HostSide second(document);
  RigSide rig_again(receiver);
  ASSERT_NO_FATAL_FAILURE(talk_until(second, rig_again, SIZE_MAX));
  ASSERT_TRUE(second.done);
  EXPECT_GT(*second.went_on_from, 500'000u - kMaxBulkBytes - 1000);
  EXPECT_EQ(rig_again.taken.at(0), *document);
}

TEST(Upload, TwoClientsAtOnce_EachDocumentArrives) {
  const auto one = shared_bytes(100, 1), two = shared_bytes(100, 2);
  const UploadSender a(one), b(two);
  UploadReceiver receiver;
  ASSERT_EQ(receiver.begin(a.sha256(), 100).value(), 0u);
  ASSERT_EQ(receiver.begin(b.sha256(), 100).value(), 0u);
  for (std::size_t at = 0; at < 100; at += 10) {
    ASSERT_TRUE(receiver.write(a.sha256(), at, whole(one).subspan(at, 10)));
    ASSERT_TRUE(receiver.write(b.sha256(), at, whole(two).subspan(at, 10)));
  }
  EXPECT_EQ(receiver.take(b.sha256()).value(), *two);
  EXPECT_EQ(receiver.take(a.sha256()).value(), *one);
}

TEST(Upload, TwoClientsSendTheSame_TheyHelpEachOther) {
  const auto document = shared_bytes(100);
  const UploadSender sender(document);
  UploadReceiver receiver;
  ASSERT_TRUE(receiver.begin(sender.sha256(), 100));
  ASSERT_TRUE(receiver.write(sender.sha256(), 0, whole(document).first(60)));
  EXPECT_EQ(receiver.begin(sender.sha256(), 100).value(), 60u);
  ASSERT_TRUE(receiver.write(sender.sha256(), 60, whole(document).subspan(60)));
  ASSERT_TRUE(receiver.write(sender.sha256(), 30, whole(document).subspan(30, 40))) << "the slower one, again";
  EXPECT_EQ(receiver.take(sender.sha256()).value(), *document);
}

TEST(Upload, OneBitWrong_ChecksumAndTheNextAttemptBeginsAnew) {
  const auto document = shared_bytes(100);
  const UploadSender sender(document);
  auto wrong = *document;
  wrong[50] ^= 1;
  UploadReceiver receiver;
  ASSERT_TRUE(receiver.begin(sender.sha256(), 100));
  ASSERT_TRUE(receiver.write(sender.sha256(), 0, wrong));
  EXPECT_EQ(receiver.take(sender.sha256()).error().code, Errc::kChecksum);
  EXPECT_EQ(receiver.begin(sender.sha256(), 100).value(), 0u);
  ASSERT_TRUE(receiver.write(sender.sha256(), 0, *document));
  EXPECT_EQ(receiver.take(sender.sha256()).value(), *document);
}

TEST(Upload, TakenTooEarly_TruncatedAndNothingLost) {
  const auto document = shared_bytes(100);
  const UploadSender sender(document);
  UploadReceiver receiver;
  EXPECT_EQ(receiver.take(sender.sha256()).error().code, Errc::kNotFound);
  ASSERT_TRUE(receiver.begin(sender.sha256(), 100));
  ASSERT_TRUE(receiver.write(sender.sha256(), 0, whole(document).first(99)));
  const auto early = receiver.take(sender.sha256());
  EXPECT_EQ(early.error().code, Errc::kTruncated);
  EXPECT_NE(early.error().message.find("99 of 100"), std::string::npos);
  EXPECT_EQ(receiver.begin(sender.sha256(), 100).value(), 99u);
}

TEST(Upload, Limits_AreKeptAndNamed) {
  const UploadSender sender(shared_bytes(100));
  UploadReceiver receiver(UploadLimits{.document_bytes = 100, .documents = 1});
  const Error error = receiver.begin(sender.sha256(), 101).error();
  EXPECT_EQ(error.code, Errc::kTooLarge);
  EXPECT_NE(error.message.find("at most 100"), std::string::npos);
  EXPECT_EQ(receiver.begin(sender.sha256(), UINT64_MAX).error().code, Errc::kTooLarge);
  ASSERT_TRUE(receiver.begin(sender.sha256(), 100));
  const std::vector<std::uint8_t> bytes(101);
  EXPECT_EQ(receiver.write(sender.sha256(), 0, bytes).error().code, Errc::kBadValue) << "past the end";
  EXPECT_EQ(receiver.write(sender.sha256(), 1, std::span(bytes).first(1)).error().code, Errc::kBadValue) << "a gap";
  EXPECT_EQ(receiver.write(sender.sha256(), UINT64_MAX, std::span(bytes).first(1)).error().code, Errc::kBadValue);
  EXPECT_EQ(receiver.begin(sender.sha256(), 100).value(), 0u) << "refused bytes are not kept";
}

TEST(Upload, MoreDocumentsThanRoom_TheOneUntouchedLongestMakesRoom) {
  const UploadSender a(shared_bytes(10, 1)), b(shared_bytes(10, 2)), c(shared_bytes(10, 3));
  UploadReceiver receiver(UploadLimits{.document_bytes = 100, .documents = 2});
  const std::vector<std::uint8_t> five(5);
  ASSERT_TRUE(receiver.begin(a.sha256(), 10));
  ASSERT_TRUE(receiver.begin(b.sha256(), 10));
  ASSERT_TRUE(receiver.write(a.sha256(), 0, five));  // a is now newer than b
  ASSERT_TRUE(receiver.begin(c.sha256(), 10));
  EXPECT_EQ(receiver.write(b.sha256(), 0, five).error().code, Errc::kNotFound);
  EXPECT_EQ(receiver.begin(a.sha256(), 10).value(), 5u);
}

TEST(Upload, SameNameAnotherLength_BeginsAnew) {
  const UploadSender a(shared_bytes(10));
  UploadReceiver receiver;
  ASSERT_TRUE(receiver.begin(a.sha256(), 20));
  ASSERT_TRUE(receiver.write(a.sha256(), 0, std::vector<std::uint8_t>(15)));
  EXPECT_EQ(receiver.begin(a.sha256(), 10).value(), 0u);
}

TEST(Upload, EmptyDocument_IsADocument) {
  const UploadSender sender(shared_bytes(0));
  UploadReceiver receiver;
  ASSERT_EQ(receiver.begin(sender.sha256(), 0).value(), 0u);
  EXPECT_TRUE(receiver.take(sender.sha256()).value().empty());
}

TEST(UploadStream, ItemsThatDoNotBeginAsUploads_AreRefused) {
  UploadReceiver receiver;
  UploadStream stream;
  BulkPiece piece;
  EXPECT_EQ(stream.piece(piece, receiver).error().code, Errc::kWrongState);
  piece.first = true;
  piece.meta = "\xFF\xFF";
  EXPECT_EQ(stream.piece(piece, receiver).error().code, Errc::kBadFormat);
  piece.meta = wire::UploadPart().SerializeAsString();
  EXPECT_EQ(stream.piece(piece, receiver).error().code, Errc::kBadValue) << "no SHA-256";
  wire::UploadPart part;
  part.set_sha256(std::string(32, 'x'));
  part.set_offset(UINT64_MAX);
  piece.meta = part.SerializeAsString();
  piece.data = {1};
  EXPECT_EQ(stream.piece(piece, receiver).error().code, Errc::kNotFound);
  piece.first = false;
  piece.offset = 1;
  EXPECT_EQ(stream.piece(piece, receiver).error().code, Errc::kBadValue);
}

TEST(UploadSender, OffsetPastTheEnd_Protocol) {
  const UploadSender sender(shared_bytes(10));
  EXPECT_TRUE(sender.item(10));
  EXPECT_EQ(sender.item(11).error().code, Errc::kProtocol);
}

Sha256 name_of(std::uint8_t i) { return sha256(std::span(&i, 1)); }

TEST(UploadReceiver, OneOwnerBeginsManyDocuments_ItsOwnMakeRoom) {
  UploadReceiver receiver(UploadLimits{1000, 8, 2});
  const auto good = shared_bytes(600);
  const Sha256 name = sha256(whole(good));
  ASSERT_EQ(receiver.begin(name, 600, 1).value(), 0u);
  ASSERT_TRUE(receiver.write(name, 0, whole(good).first(300)));
  for (std::uint8_t i = 0; i < 200; ++i) ASSERT_TRUE(receiver.begin(name_of(i), 1000, 2));
  EXPECT_EQ(receiver.begin(name, 600, 1).value(), 300u) << "what another owner began is untouched";
  EXPECT_FALSE(receiver.write(name_of(197), 0, whole(good).first(1)));
  EXPECT_TRUE(receiver.write(name_of(198), 0, whole(good).first(1)));
  EXPECT_TRUE(receiver.write(name_of(199), 0, whole(good).first(1)));
}

TEST(UploadReceiver, OwnersThatLeftMakeRoomFirst) {
  UploadReceiver receiver(UploadLimits{1000, 4, 2});
  for (std::uint8_t i = 0; i < 4; ++i) ASSERT_TRUE(receiver.begin(name_of(i), 10, 1 + i / 2));
  receiver.leave(2);
  EXPECT_TRUE(receiver.begin(name_of(10), 10, 3));
  EXPECT_TRUE(receiver.begin(name_of(11), 10, 3));
  const std::vector<std::uint8_t> byte{1};
  for (const int i : {0, 1, 10, 11}) EXPECT_TRUE(receiver.write(name_of(static_cast<std::uint8_t>(i)), 0, byte)) << i;
  for (const int i : {2, 3}) EXPECT_FALSE(receiver.write(name_of(static_cast<std::uint8_t>(i)), 0, byte)) << i;
}

}  // namespace
}  // namespace nodal
