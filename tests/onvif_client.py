#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""An ONVIF client of the tests: onvif_client.py PORT USER PASSWORD [FOUND]. Searches, asks what recorders ask in the order in which they
do, and prints the address of the stream. Ends with 1 at the first answer that they could not use."""
import base64
import datetime
import hashlib
import os
import re
import socket
import sys
import urllib.error
import urllib.request

DEVICE, MEDIA, MEDIA2, EVENTS = ("http://www.onvif.org/" + s for s in (
    "ver10/device/wsdl", "ver10/media/wsdl", "ver20/media/wsdl", "ver10/events/wsdl"))
WSS = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-"
PORT, USER, PASSWORD = int(sys.argv[1]), sys.argv[2], sys.argv[3]
HERE = f"http://127.0.0.1:{PORT}"


def fail(*words):
    print("FAIL:", *words)
    sys.exit(1)


def token(password, created=None):
    """A WS-UsernameToken, by default made now."""
    nonce = os.urandom(16)
    created = created or datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    digest = base64.b64encode(hashlib.sha1(nonce + (created + password).encode()).digest()).decode()
    return (f'<w:Security xmlns:w="{WSS}wssecurity-secext-1.0.xsd"><w:UsernameToken><w:Username>{USER}</w:Username>'
            f'<w:Password Type="{WSS}username-token-profile-1.0#PasswordDigest">{digest}</w:Password>'
            f'<w:Nonce>{base64.b64encode(nonce).decode()}</w:Nonce>'
            f'<u:Created xmlns:u="{WSS}wssecurity-utility-1.0.xsd">{created}</u:Created></w:UsernameToken></w:Security>')


def post(url, text):
    """Status and answer."""
    request = urllib.request.Request(url, text.encode(), {"Content-Type": "application/soap+xml; charset=utf-8"})
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def ask(service, call, inner="", head=None, url=HERE + "/onvif/device_service"):
    head = token(PASSWORD) if head is None else head
    return post(url, f'<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"><s:Header>{head}</s:Header><s:Body>'
                     f'<{call} xmlns="{service}">{inner}</{call}></s:Body></s:Envelope>')


def want(status, words, *call, **options):
    """The answer to a call, with that status and all words."""
    got, answer = ask(*call, **options)
    for word in words:
        if not re.search(word, answer):
            fail(call[1], "has no", word, "in", answer[-900:])
    if got != status:
        fail(call[1], "has status", got, answer[-900:])
    return answer


def search():
    """The device's address as a Probe on the loopback finds it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        s.settimeout(1)
        for i in range(60):
            s.sendto(f'<e:Envelope xmlns:e="http://www.w3.org/2003/05/soap-envelope" xmlns:w="http://schemas.xmlsoap.org/ws/2004/08/addressing"'
                     f' xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery"><e:Header><w:MessageID>uuid:{i}</w:MessageID>'
                     f'<w:Action>http://schemas.xmlsoap.org/ws/2005/04/discovery/Probe</w:Action></e:Header><e:Body><d:Probe>'
                     f'<d:Types xmlns:n="http://www.onvif.org/ver10/network/wsdl">n:NetworkVideoTransmitter</d:Types></d:Probe></e:Body>'
                     f'</e:Envelope>'.encode(), ("239.255.255.250", 3702))
            try:
                while True:
                    answer = s.recv(65536).decode()
                    if f":{PORT}/" in answer:
                        return re.search("<d:XAddrs>(.*)</d:XAddrs>", answer).group(1)
            except socket.timeout:
                pass
    return fail("no answer to a Probe")


def synology():
    """As Surveillance Station asks when a camera is added and then watched."""
    want(200, ["<tt:Year>20", "<tt:TZ>"], DEVICE, "GetSystemDateAndTime", head="")
    want(200, [f"<tt:Media><tt:XAddr>{HERE}/onvif/media_service<", f"<tt:Events><tt:XAddr>{HERE}/onvif/event_service<"],
         DEVICE, "GetCapabilities", "<Category>All</Category>")
    want(200, ["<tds:Manufacturer>sst<", "<tds:SerialNumber>[0-9a-f]{12}<"], DEVICE, "GetDeviceInformation")
    want(200, ["<tt:VideoSourceConfiguration token", "<tt:VideoEncoderConfiguration token"], MEDIA, "GetProfiles")
    want(200, ['<trt:VideoSources token="main">'], MEDIA, "GetVideoSources")
    want(200, ["<tt:H264Profile>Baseline<"], MEDIA, "GetVideoEncoderConfiguration",
         "<ConfigurationToken>main_encoder</ConfigurationToken>")
    want(200, ["<tt:H264><tt:ResolutionsAvailable>"], MEDIA, "GetVideoEncoderConfigurationOptions",
         "<ConfigurationToken>main_encoder</ConfigurationToken><ProfileToken>main</ProfileToken>")
    for protocol in "UDP", "RTSP":
        stream = want(200, ["<tt:Uri>rtsp://"], MEDIA, "GetStreamUri",
                      f'<StreamSetup><Stream xmlns="http://www.onvif.org/ver10/schema">RTP-Unicast</Stream><Transport '
                      f'xmlns="http://www.onvif.org/ver10/schema"><Protocol>{protocol}</Protocol></Transport></StreamSetup>'
                      f'<ProfileToken>main</ProfileToken>')
    want(200, [f"<tt:Uri>{HERE}/snapshot<"], MEDIA, "GetSnapshotUri", "<ProfileToken>main</ProfileToken>")
    want(500, ["s:Receiver", "ter:ActionNotSupported"], "http://www.onvif.org/ver20/ptz/wsdl", "GetNodes")
    return re.search("<tt:Uri>(.*)</tt:Uri>", stream).group(1)


def protect():
    """As UniFi Protect asks to adopt a third party's camera."""
    want(200, ["<tt:UTCDateTime>"], DEVICE, "GetSystemDateAndTime", head="")
    want(200, ["ver20/media/wsdl</tds:Namespace>"], DEVICE, "GetServices", "<IncludeCapability>false</IncludeCapability>", head="")
    want(200, ["<tt:HwAddress>[0-9a-f:]{17}<"], DEVICE, "GetNetworkInterfaces")
    want(200, ["onvif://www.onvif.org/Profile/T"], DEVICE, "GetScopes")
    # Each of these is needed in the control of the rate.
    want(200, ["<tt:RateControl><tt:FrameRateLimit>[1-9]\\d*</tt:FrameRateLimit><tt:EncodingInterval>1</tt:EncodingInterval>"
               "<tt:BitrateLimit>[1-9]\\d*</tt:BitrateLimit></tt:RateControl>"], MEDIA, "GetProfiles")
    want(200, ["<tr2:VideoEncoder token", "<tt:Encoding>H264<"], MEDIA2, "GetProfiles", "<Type>All</Type>")
    want(200, ["<tr2:Uri>rtsp://"], MEDIA2, "GetStreamUri", "<Protocol>RtspUnicast</Protocol><ProfileToken>main</ProfileToken>")
    events()


def events():
    answer = want(200, ["/onvif/events/"], EVENTS, "CreatePullPointSubscription", "<InitialTerminationTime>PT60S</InitialTerminationTime>")
    place = re.search("<wsa:Address>(.*)</wsa:Address>", answer).group(1)
    pull = "<Timeout>PT2S</Timeout><MessageLimit>100</MessageLimit>"
    want(200, ["tns1:VideoSource/MotionAlarm", "tns1:RuleEngine/MyRuleDetector/PeopleDetect", 'Name="Rule" Value="gate"'],
         EVENTS, "PullMessages", pull, url=place)
    want(200, ["TerminationTime"], "http://docs.oasis-open.org/wsn/b-2", "Renew", "<TerminationTime>PT5M</TerminationTime>", url=place)
    want(200, [""], "http://docs.oasis-open.org/wsn/b-2", "Unsubscribe", url=place)
    want(400, ["ResourceUnknownFault"], EVENTS, "PullMessages", pull, url=place)


def strangers():
    """Others get nothing."""
    want(401, ["s:Sender", "ter:NotAuthorized"], MEDIA, "GetProfiles", head="")
    want(401, ["ter:NotAuthorized"], MEDIA, "GetProfiles", head=token("sesame"))
    want(401, ["ter:NotAuthorized"], MEDIA, "GetProfiles", head=token(PASSWORD, "2020-01-01T00:00:00Z"))
    once = token(PASSWORD)
    want(200, ["Profiles"], MEDIA, "GetProfiles", head=once)
    want(401, ["ter:NotAuthorized"], MEDIA, "GetProfiles", head=once)
    for text in ("hello", "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "<a>" * 100):
        if post(HERE + "/onvif/device_service", text)[0] != 400:
            fail("accepted:", text[:40])
    try:
        urllib.request.urlopen(HERE + "/snapshot", timeout=60)
        fail("a picture without a password")
    except urllib.error.HTTPError as error:
        if error.code != 401:
            fail("a picture without a password: status", error.code)
    login = urllib.request.HTTPPasswordMgrWithDefaultRealm()
    login.add_password(None, HERE, USER, PASSWORD)
    with urllib.request.build_opener(urllib.request.HTTPDigestAuthHandler(login)).open(HERE + "/snapshot", timeout=60) as answer:
        if answer.read(2) != b"\xff\xd8":
            fail("no JPEG at /snapshot")


def main():
    found = search()
    if found != HERE + "/onvif/device_service":
        fail("found at", found)
    uri = synology()
    protect()
    strangers()
    print(uri)


main()
