"""Arguments that cannot be used are refused with exit code 2 and a message that names them."""

import pytest

from gi_engine import arguments, cli


def refused(capfd, *argv) -> str:
    assert cli.run(list(argv)) == cli.BAD_ARGUMENTS
    return capfd.readouterr().err


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--samples", "0"),
        ("--samples", "-1"),
        ("--samples", "many"),
        ("--samples", "1.5"),
        ("--time", "0"),
        ("--time", "nan"),
        ("--time", "inf"),
        ("--noise", "-0.1"),
        ("--noise", "low"),
        ("--resolution", "640"),
        ("--resolution", "0x10"),
        ("--resolution", "99999x10"),
        ("--frame", "5-1"),
        ("--frame", "x"),
        ("--threads", "0"),
        ("--seed", "-1"),
        ("--seed", "2147483648"),
        ("--set", "max_bounces"),
        ("--set", "=3"),
    ],
)
def test_bad_values(capfd, option, value):
    message = refused(capfd, "render", "scene.blend", f"{option}={value}")
    assert option in message
    assert value.split("=")[0] in message


def test_limits_exclude_one_another(capfd):
    assert "--samples" in refused(capfd, "render", "scene.blend", "--samples", "3", "--time", "2")


def test_unknown_command_and_option(capfd):
    assert "paint" in refused(capfd, "paint")
    assert "--colour" in refused(capfd, "render", "scene.blend", "--colour", "red")
    assert "COMMAND" in refused(capfd)


def test_help_is_no_error(capfd):
    assert cli.run(["--help"]) == cli.DONE
    assert "130 cancelled" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("text", "expected"), [("7", [7]), ("2-4", [2, 3, 4]), ("-3", [-3]), ("-3--1", [-3, -2, -1]), ("-1-1", [-1, 0, 1])]
)
def test_frames(text, expected):
    assert list(arguments.frames(text)) == expected


PARAMETERS = {
    "id": "path",
    "parameters": [
        {"name": "max_bounces", "type": "int", "default": 12, "min": 0, "max": 1024},
        {"name": "alpha", "type": "float", "default": 0.5, "min": 0.0, "max": 1.0},
        {"name": "caustics", "type": "bool", "default": True},
        {"name": "mode", "type": "enum", "default": "mis", "items": [("off", "Off", ""), ("mis", "MIS", "")]},
    ],
}


@pytest.mark.parametrize("value", [{"max_bounces": "3"}, {"alpha": "0.25"}, {"caustics": "off"}, {"mode": "off"}])
def test_good_parameters(value):
    arguments.check_parameters(PARAMETERS, value)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"bounces": "3"}, ["bounces", "max_bounces", "alpha", "path"]),
        ({"max_bounces": "3.5"}, ["max_bounces", "whole", "3.5"]),
        ({"max_bounces": "-1"}, ["max_bounces", "0", "1024"]),
        ({"alpha": "nan"}, ["alpha", "nan"]),
        ({"caustics": "maybe"}, ["caustics", "maybe"]),
        ({"mode": "on"}, ["mode", "off, mis"]),
    ],
)
def test_bad_parameters_name_what_would_do(value, words):
    with pytest.raises(arguments.ArgumentError) as caught:
        arguments.check_parameters(PARAMETERS, value)
    assert all(word in str(caught.value) for word in words)
