// Requests to the studio's server, by relative addresses, which include the token.

import { Picture, halfLight } from "viewer/light.js";

const LIGHT = halfLight();
// Tells this page from others that are open: a request only overtakes those of its own page.
export const PAGE = Math.random().toString(36).slice(2, 12);

export class Refused extends Error {}
export class Stale extends Error {}

async function answered(response) {
  if (response.status === 204) {
    await response.arrayBuffer();  // what is not read to its end keeps its connection, of six
    throw new Stale();
  }
  if (response.ok) return response;
  let told = {};
  try { told = await response.json(); } catch { /* no words */ }
  throw new Refused(told.error || `the studio answered ${response.status}`);
}

async function fetched(path, options) {
  try {
    // Past the browser's cache, in which equal requests would wait for one another.
    return await answered(await fetch(path, { cache: "no-store", ...options }));
  } catch (error) {
    if (error instanceof TypeError) throw new Refused("The studio does not respond. Is it still running in its terminal?");
    throw error;
  }
}

export const get = async (path) => (await fetched(path)).json();

export async function file(path) {
  const response = await fetched(path);
  return new Blob([await response.arrayBuffer()], { type: response.headers.get("content-type") });
}

const posted = (path, body) => fetched(path, {
  method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
});
export const post = async (path, body) => (await posted(path, body)).json();

async function pictureOf(response, primaries) {
  const number = (name) => Number(response.headers.get(`x-${name}`));
  const name = response.headers.get("x-primaries");
  return {
    peak: number("peak"),
    madeBy: response.headers.get("x-made-by"),
    picture: new Picture({
      width: number("width"), height: number("height"), channels: number("channels"),
      codes: new Uint16Array(await response.arrayBuffer()), light: LIGHT,
      primaries: { name, ...primaries[name] },
    }),
  };
}

// A picture and the key of what it depends on: a version of the settings, or how SDR is read.
export async function picture(asked, primaries) {
  const query = new URLSearchParams({ ...asked, page: PAGE });
  return pictureOf(await fetched(`api/picture?${query}`), primaries);
}

export async function attempt(asked, primaries) {
  return pictureOf(await posted("api/try", { ...asked, page: PAGE }), primaries);
}
