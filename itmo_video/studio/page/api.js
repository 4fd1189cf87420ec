// Requests to the studio's server, by relative addresses, which include the token.

import { Picture, halfLight } from "viewer/light.js";

const LIGHT = halfLight();

export class Refused extends Error {}
export class Stale extends Error {}

async function answered(response) {
  if (response.ok) return response;
  let told = {};
  try { told = await response.json(); } catch { /* no words */ }
  if (told.stale) throw new Stale();
  const error = new Refused(told.error || `the studio answered ${response.status}`);
  error.exists = Boolean(told.exists);
  throw error;
}

async function fetched(path, options) {
  try {
    return await answered(await fetch(path, options));
  } catch (error) {
    if (error instanceof TypeError) throw new Refused("The studio does not respond. Is it still running in its terminal?");
    throw error;
  }
}

export const get = async (path) => (await fetched(path)).json();

const posted = (path, body) => fetched(path, {
  method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
});
export const post = async (path, body) => (await posted(path, body)).json();

async function pictureOf(response, primaries) {
  const number = (name) => Number(response.headers.get(`x-${name}`));
  const name = response.headers.get("x-primaries");
  return {
    version: number("version"),
    picture: new Picture({
      width: number("width"), height: number("height"), channels: number("channels"),
      codes: new Uint16Array(await response.arrayBuffer()), light: LIGHT,
      primaries: { name, ...primaries[name] },
    }),
  };
}

// A picture and the version of the settings that it was rendered with.
export async function picture(asked, primaries) {
  return pictureOf(await fetched(`api/picture?${new URLSearchParams(asked)}`), primaries);
}

export async function attempt(asked, primaries) {
  return (await pictureOf(await posted("api/try", asked), primaries)).picture;
}
