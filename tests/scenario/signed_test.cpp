// A rig with signers in rig.toml uses no calibration that none of them signed, wherever it came from.
#include <gtest/gtest.h>

#include "tests/scenario/stand.h"
#include "tests/support/ssh_keys.h"

namespace nodal::scenario {
namespace {

std::string id_of(const Calibration& calibration) { return sha256_to_wire(calibration_id(calibration)); }

class Signed : public testing::Test {
 protected:
  StandOptions trusting(const std::string& allowed_signers) {
    StandOptions options;
    auto signers = AllowedSigners::parse(allowed_signers);
    EXPECT_TRUE(signers) << signers.error().text();
    options.config.signers = std::move(*signers);
    return options;
  }
  /// Uploads the document with the signature; `trial_ns` 0: permanently.
  wire::Reply upload(Stand& stand, TestHost& host, const std::string& document, const std::string& signature,
                     std::uint64_t trial_ns = 0) {
    host.send_document(document);
    stand.run(Duration::seconds(1));  // control frames overtake bulk frames
    wire::Request commit;
    const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
    *commit.mutable_upload_commit() = UploadSender(bytes).commit();
    commit.mutable_upload_commit()->set_signature(signature);
    if (trial_ns != 0) commit.mutable_upload_commit()->set_trial_ns(trial_ns);
    return host.ask(commit);
  }
  static wire::Reply rollback(TestHost& host) {
    wire::Request request;
    request.mutable_calibration_rollback();
    return host.ask(request);
  }

  test::SshKeys keys_;
  const std::string ann_ = "ann " + keys_.make("ann");
  const std::string bob_ = "bob " + keys_.make("bob");
  const Calibration first_ = small_calibration("first");
  const Calibration second_ = small_calibration("second");
};

TEST_F(Signed, OnlyWhatASignerSignedForCalibrations_ComesIntoForce) {
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  const std::string document = to_json(first_);
  const auto refused_as = [&](const std::string& signature, Errc code) {
    const wire::Reply reply = upload(stand, host, document, signature);
    EXPECT_EQ(reply.error().code(), static_cast<std::uint32_t>(code)) << reply.error().message();
    EXPECT_EQ(host.status().calibration_id(), "");
  };
  refused_as("", Errc::kBadValue);
  refused_as(keys_.sign("bob", document), Errc::kBadValue);
  refused_as(keys_.sign("ann", document, "git"), Errc::kBadValue);
  refused_as(keys_.sign("ann", to_json(second_)), Errc::kChecksum);
  refused_as(std::string(5000, 'x'), Errc::kTooLarge);
  EXPECT_TRUE(upload(stand, host, document, keys_.sign("ann", document)).has_done());
  EXPECT_EQ(host.status().calibration_id(), id_of(first_));
}

TEST_F(Signed, AfterARestart_WhatWasSignedRunsAndWhatWasNotDoesNot) {
  Stand open;
  TestHost& host = open.connect();
  open.run(Duration::milliseconds(100));
  ASSERT_TRUE(host.upload(to_json(first_)).has_done()) << "before the rule came in";

  Stand strict(trusting(ann_), open.disk->after_power_loss(1));
  TestHost& other = strict.connect();
  strict.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), "");
  EXPECT_NE(other.status().problem().find("not signed"), std::string::npos) << other.status().problem();
  wire::Request use;
  use.mutable_calibration_use()->set_id(id_of(first_));
  EXPECT_EQ(other.ask(use).error().code(), static_cast<std::uint32_t>(Errc::kBadValue));
  const std::string document = to_json(first_);
  ASSERT_TRUE(upload(strict, other, document, keys_.sign("ann", document)).has_done()) << "the same, signed by now";

  Stand again(trusting(ann_), strict.disk->after_power_loss(2));
  TestHost& last = again.connect();
  again.run(Duration::seconds(1));
  EXPECT_EQ(last.status().calibration_id(), id_of(first_));
}

TEST_F(Signed, ASignerWhoIsNoLongerTrusted_IsNoWayBack) {
  Stand stand(trusting(ann_ + bob_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  ASSERT_TRUE(upload(stand, host, to_json(first_), keys_.sign("ann", to_json(first_))).has_done());
  ASSERT_TRUE(upload(stand, host, to_json(second_), keys_.sign("bob", to_json(second_))).has_done());

  Stand strict(trusting(bob_), stand.disk->after_power_loss(3));
  TestHost& other = strict.connect();
  strict.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), id_of(second_));
  EXPECT_EQ(rollback(other).error().code(), static_cast<std::uint32_t>(Errc::kBadValue));
  EXPECT_EQ(other.status().calibration_id(), id_of(second_));
}

TEST_F(Signed, ATrial_NeedsASignatureAndKeepsIt) {
  constexpr std::uint64_t kTrial_ns = 30'000'000'000;
  Stand stand(trusting(ann_));
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(100));
  ASSERT_TRUE(upload(stand, host, to_json(first_), keys_.sign("ann", to_json(first_))).has_done());
  EXPECT_EQ(upload(stand, host, to_json(second_), "", kTrial_ns).error().code(),
            static_cast<std::uint32_t>(Errc::kBadValue));
  ASSERT_TRUE(upload(stand, host, to_json(second_), keys_.sign("ann", to_json(second_)), kTrial_ns).has_done());
  wire::Request keep;
  keep.mutable_trial_end()->set_keep(true);
  ASSERT_TRUE(host.ask(keep).has_done());

  Stand again(trusting(ann_), stand.disk->after_power_loss(4));
  TestHost& other = again.connect();
  again.run(Duration::seconds(1));
  EXPECT_EQ(other.status().calibration_id(), id_of(second_));
}

}  // namespace
}  // namespace nodal::scenario
