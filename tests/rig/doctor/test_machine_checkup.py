"""Checks of the computer: this one, and simulated ones made of a few files."""

import os
import socket
import sys

import pytest

from midair.rig.doctor.checkup import machine_findings, rx_delay

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="files of Linux")

LINK = "fe8000000000000000fcabfffe21d5cd 02 40 20 80     eth0\n"
LIMITS = (
    "Limit                     Soft Limit           Hard Limit           Units     \n"
    "Max locked memory         {1:<21}{1:<21}bytes\n"
    "Max realtime priority     {0:<21}{0:<21}\nMax realtime timeout      unlimited            unlimited            us\n"
)
STATUS = "Name:\tpython\nUid:\t1000\t1000\t1000\t1000\nGid:\t1000\t1000\t1000\t1000\nGroups:\t{}\n"
GROUPS = "root:x:0:\ndialout:x:20:{}\naudio:x:29:\n"

WELL = {
    "proc/net/if_inet6": LINK,
    "proc/sys/net/ipv6/conf/all/disable_ipv6": "0\n",
    "proc/modules": "snd 1 0 - Live 0x0\n",
    "proc/self/limits": LIMITS.format(20, "unlimited"),
    "proc/self/status": STATUS.format("20 29 1000"),
    "etc/group": GROUPS.format("somebody"),
    "sys/class/net/eth0/device": None,
    "sys/class/net/lo/mtu": "65536\n",
}


def found(root, files, delay=0):
    for name, content in {**WELL, **files}.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if content is None:
            path.mkdir()
        elif content:
            path.write_text(content, encoding="utf-8")
    return {each.subject: each for each in machine_findings(root, moderation=lambda card: delay)}


def test_this_computer_is_looked_at_without_any_right():
    findings = machine_findings()
    assert [each.subject for each in findings if each.state == "broken"] == []
    assert all(each.advice for each in findings if each.state != "ok")
    assert {"IPv6", "firewall", "real-time priority", "locked memory", "group dialout", "group audio", "room"} <= {
        each.subject for each in findings
    }
    # Against what the system says by other ways.
    by_subject = {each.subject: each for each in findings}
    assert (by_subject["IPv6"].found != "off") == os.path.exists("/proc/net/if_inet6")
    cards = {name for _, name in socket.if_nameindex()}
    assert {each.subject.removeprefix("interrupts of ") for each in findings if "interrupts" in each.subject} <= cards


def test_a_good_computer_needs_no_advice(tmp_path):
    findings = found(tmp_path, {})
    assert [each for each in findings.values() if each.state != "ok" or each.advice] == []
    assert findings["IPv6"].found == "addresses on eth0"
    assert findings["real-time priority"].found == "up to 20"
    assert "interrupts of lo" not in findings


UNWELL = {
    "no IPv6": ({"proc/net/if_inet6": ""}, "IPv6", "missing", "off", "net.ipv6.conf.all.disable_ipv6=0"),
    "IPv6 switched off": (
        {"proc/sys/net/ipv6/conf/all/disable_ipv6": "1\n"},
        "IPv6",
        "missing",
        "off",
        "net.ipv6.conf.all.disable_ipv6=0",
    ),
    "loopback only": (
        {"proc/net/if_inet6": "00000000000000000000000000000001 01 80 10 80       lo\n"},
        "IPv6",
        "missing",
        "no card has an address",
        "fe80",
    ),
    "ufw": ({"etc/ufw/ufw.conf": "ENABLED=yes\n"}, "firewall", "ok", "UDP from port 44336", "sudo ufw allow"),
    "firewalld": ({"run/firewalld": None}, "firewall", "ok", "firewalld", "--add-source-port=44336/udp"),
    "netfilter": ({"proc/modules": "nf_tables 1 0 - Live 0x0\n"}, "firewall", "ok", "kernel's filter", "nft list"),
    "no priority": (
        {"proc/self/limits": LIMITS.format(0, "unlimited")},
        "real-time priority",
        "missing",
        "not allowed",
        "rtprio",
    ),
    "little locked memory": (
        {"proc/self/limits": LIMITS.format(20, 8_388_608)},
        "locked memory",
        "missing",
        "up to 8.39 MB",
        "memlock unlimited",
    ),
    "no limits": ({"proc/self/limits": ""}, "real-time priority", "missing", "not reported", "rtprio"),
    "no dialout": (
        {"proc/self/status": STATUS.format("29 1000")},
        "group dialout",
        "missing",
        "serial sensors",
        "usermod -aG dialout $USER",
    ),
    "dialout not in force": (
        {"proc/self/status": STATUS.format("1000"), "etc/group": GROUPS.format("x,a-tester")},
        "group dialout",
        "missing",
        "active after the next login",
        "log out and in again",
    ),
    "no audio": (
        {"proc/self/status": STATUS.format("20")},
        "group audio",
        "missing",
        "sound cards",
        "usermod -aG audio $USER",
    ),
}


@pytest.mark.parametrize("case", UNWELL)
def test_each_problem_of_the_computer_gives_advice(case, tmp_path, monkeypatch):
    monkeypatch.setenv("USER", "a-tester")
    files, subject, state, word, advice = UNWELL[case]
    finding = found(tmp_path, files)[subject]
    assert finding.state == state
    assert word in finding.found
    assert advice in finding.advice
    assert "\n" not in finding.advice


@pytest.mark.parametrize(("delay", "word"), [(None, "does not report"), (50, "waits 50 us")])
def test_an_interrupt_delay_is_reported(delay, word, tmp_path):
    finding = found(tmp_path, {}, delay)["interrupts of eth0"]
    assert word in finding.found
    assert "sudo ethtool -C eth0" in finding.advice


def test_a_firewall_that_is_off_is_none(tmp_path):
    assert found(tmp_path, {"etc/ufw/ufw.conf": "ENABLED=no\n"})["firewall"].found == "none seen"


def test_root_may_all(tmp_path):
    root = "Uid:\t0\t0\t0\t0\nGid:\t0\t0\t0\t0\nGroups:\t0\n"
    findings = found(tmp_path, {"proc/self/status": root, "proc/self/limits": LIMITS.format(0, 8_388_608)})
    assert {each.state for each in findings.values()} == {"ok"}


def test_unreadable_system_files_are_no_error(tmp_path):
    findings = machine_findings(tmp_path)
    assert all(each.advice for each in findings if each.state != "ok")


def test_a_full_disk_is_reported(monkeypatch):
    from midair.rig.doctor import checkup

    monkeypatch.setattr(checkup, "ROOM", 1e30)
    finding = {each.subject: each for each in machine_findings()}["room"]
    assert finding.state == "missing"
    assert "free disk space" in finding.advice


def test_a_card_that_is_not_there_has_no_delay():
    assert rx_delay("nosuchcard0") is None
    assert rx_delay("a name that is longer than the system's") is None
