// Signatures of the real ssh-keygen, and everything that must not be accepted as one.
#include "protocol/ssh_signature.h"

#include <gtest/gtest.h>

#include "protocol/signed_for.h"
#include "tests/support/ssh_keys.h"

namespace nodal {
namespace {

const std::string kDocument = "{\"nodal_calibration\": 1}\n";

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

class SshSignature : public testing::Test {
 protected:
  Result<std::string> verify(const std::string& signature, const std::string& document = kDocument) {
    auto signers = AllowedSigners::parse(allowed_);
    EXPECT_TRUE(signers) << signers.error().text();
    const auto verified = signers->verify(bytes_of(document), signature, kCalibrationNamespace);
    if (!verified) return fail(verified.error());
    name_space_ = verified->name_space;
    return verified->principals;
  }
  static void expect_error(const Result<std::string>& result, Errc code, const std::string& words) {
    ASSERT_FALSE(result) << "accepted as " << *result;
    EXPECT_EQ(result.error().code, code) << result.error().text();
    EXPECT_NE(result.error().message.find(words), std::string::npos) << result.error().message;
  }

  test::SshKeys keys_;
  const std::string ann_ = keys_.make("ann");
  const std::string bob_ = keys_.make("bob");
  std::string name_space_;  ///< name space of the signature that was accepted last
  std::string allowed_ = "# who may\n\nann@example namespaces=\"git,nodal-calibration\" " + ann_;
};

TEST_F(SshSignature, OfATrustedKey_IsAcceptedHereAndBySshKeygen) {
  for (const char* hash : {"sha512", "sha256"}) {
    for (const std::string& document : {kDocument, std::string(), std::string(100'000, 'x')}) {
      const std::string signature = keys_.sign("ann", document, "nodal-calibration", hash);
      const auto who = verify(signature, document);
      ASSERT_TRUE(who) << who.error().text();
      EXPECT_EQ(*who, "ann@example");
      EXPECT_TRUE(keys_.verifies(allowed_, "ann@example", document, signature));
    }
  }
}

TEST_F(SshSignature, None_IsRefused) { expect_error(verify(""), Errc::kBadValue, "not signed"); }

TEST_F(SshSignature, ForANamespaceBelow_IsAcceptedWithItsWholeName) {
  for (const char* trusted : {"nodal-calibration", "nodal-calibration*", "git,nodal-calibration:bridge:7"}) {
    allowed_ = std::string("ann@example namespaces=\"") + trusted + "\" " + ann_;
    ASSERT_TRUE(verify(keys_.sign("ann", kDocument, "nodal-calibration:bridge:7"))) << trusted;
    EXPECT_EQ(name_space_, "nodal-calibration:bridge:7");
  }
  EXPECT_TRUE(keys_.verifies("ann@example namespaces=\"nodal-calibration*\" " + ann_, "ann@example", kDocument,
                             keys_.sign("ann", kDocument, "nodal-calibration:bridge:7"), "nodal-calibration:bridge:7"));
  allowed_ = "ann@example namespaces=\"nodal-calibration:bridge:8\" " + ann_;
  expect_error(verify(keys_.sign("ann", kDocument, "nodal-calibration:bridge:7")), Errc::kBadValue, "allowed signers");
  expect_error(verify(keys_.sign("ann", kDocument, "nodal-calibrations")), Errc::kBadValue, "nodal-calibrations");
}

TEST(SignedFor, RigAndGeneration_AreReadFromTheNamespaceAndWrittenBack) {
  for (const SignedFor& what : {SignedFor{"bridge", 1}, SignedFor{"rig_7.b-c", UINT64_MAX}}) {
    EXPECT_EQ(parse_namespace(namespace_of(what)).value(), what);
  }
  for (const char* text : {"", "nodal-calibration", "nodal-calibration:", "nodal-calibration:bridge",
                           "nodal-calibration:bridge:", "nodal-calibration:bridge:0", "nodal-calibration:bridge:01",
                           "nodal-calibration:bridge:-1", "nodal-calibration:bridge:1 ", "nodal-calibration::x",
                           "nodal-calibration:bridge:18446744073709551616", "git:bridge:1"}) {
    EXPECT_FALSE(parse_namespace(text)) << text;
  }
}

TEST_F(SshSignature, OfAKeyNobodyTrusts_IsRefused) {
  expect_error(verify(keys_.sign("bob", kDocument)), Errc::kBadValue, "allowed signers");
}

TEST_F(SshSignature, OfAKeyTrustedForAnotherNamespaceOnly_IsRefused) {
  allowed_ = "bob@example namespaces=\"git\" " + bob_;
  expect_error(verify(keys_.sign("bob", kDocument)), Errc::kBadValue, "allowed signers");
}

TEST_F(SshSignature, ForAnotherNamespace_IsRefused) {
  expect_error(verify(keys_.sign("ann", kDocument, "git")), Errc::kBadValue, "namespace 'git'");
}

TEST_F(SshSignature, OfAnotherDocument_IsRefused) {
  expect_error(verify(keys_.sign("ann", kDocument), kDocument + " "), Errc::kChecksum, "another document");
}

TEST_F(SshSignature, OfAnotherKindOfKey_IsNamed) {
  keys_.make("rsa", "rsa");
  expect_error(verify(keys_.sign("rsa", kDocument)), Errc::kUnsupported, "ssh-rsa");
}

TEST_F(SshSignature, WithAnyCharacterChangedOrCutOff_IsRefused) {
  const std::string whole = keys_.sign("ann", kDocument);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = damaged[at] == 'A' ? 'B' : 'A';
    // Text after the end line is not part of the signature.
    const bool after = at >= whole.find("END SSH SIGNATURE-----") + 22;
    EXPECT_EQ(verify(damaged).has_value(), after) << at;
    if (at < whole.size() - 1) {
      EXPECT_FALSE(verify(whole.substr(0, at))) << at;
    }
  }
  expect_error(verify(std::string(10'000, 'x')), Errc::kTooLarge, "4096");
}

TEST_F(SshSignature, LongerThanTheLimit_IsRefused) {
  expect_error(verify(std::string(kMaxSignatureBytes + 1, 'A')), Errc::kTooLarge, std::to_string(kMaxSignatureBytes));
}

TEST_F(SshSignature, AllowedSignersThatWouldTrustTooMuchIfReadLightly_AreRefusedByLine) {
  const std::vector<std::string> lines{"ann cert-authority " + ann_,
                                       "ann valid-before=\"20200101\" " + ann_,
                                       "ann ssh-ed25519 AAAA",
                                       "ann ssh-ed25519 !!!!",
                                       "ann",
                                       "ann ssh-rsa AAAA",
                                       "\xFF\x1B[2J"};
  for (const std::string& line : lines) {
    const auto signers = AllowedSigners::parse("# first\n" + line);
    ASSERT_FALSE(signers) << line;
    EXPECT_EQ(signers.error().message.find("line 2: "), 0u) << signers.error().message;
  }
  EXPECT_FALSE(AllowedSigners::parse("# nobody\n")) << "then no calibration could ever be accepted";
  std::string many;
  for (std::size_t i = 0; i <= kMaxSigners; ++i) many += "ann " + ann_;
  EXPECT_EQ(AllowedSigners::parse(many).error().code, Errc::kTooLarge);
}

}  // namespace
}  // namespace nodal
