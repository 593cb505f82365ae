// A board that runs: the WebSocket, which comes back by itself.

/**
 * @typedef {{description: (text: string) => void, frames: (bytes: Uint8Array<ArrayBuffer>) => void,
 *   answer: (text: string) => void, bookmarks: (text: string) => void, state: (text: string, lost: boolean) => void}} Listener
 */

const FIRST_PAUSE = 250;
const LONGEST_PAUSE = 4000;

/** The connection to a server. */
export class Live {
  /** @param {Listener} listener */
  constructor(listener) {
    this.listener = listener;
    /** @type {WebSocket | null} */
    this.socket = null;
    this.pause = FIRST_PAUSE;
  }

  /** Show the one-time code of the link, which stands in its fragment, and connect. */
  async begin() {
    const code = location.hash.slice(1);
    if (code) {
      history.replaceState(null, "", location.pathname + location.search);
      try {
        const answer = await fetch("enter", { method: "POST", body: code });
        if (!answer.ok) this.listener.state("the code of this link was used or is wrong", true);
      } catch {
        this.listener.state("no answer from the server", true);
      }
    }
    this.#connect();
  }

  #connect() {
    const address = new URL("live", location.href);
    address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onmessage = ({ data }) => {
      this.pause = FIRST_PAUSE;
      if (typeof data !== "string") this.listener.frames(new Uint8Array(data));
      else if (data.startsWith('{"answer"')) this.listener.answer(data);
      else if (data.startsWith('{"bookmarks"')) this.listener.bookmarks(data);
      else {
        this.listener.description(data);
        this.listener.state("live", false);
      }
    };
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.listener.state("not connected; trying again", true);
      setTimeout(() => this.#connect(), this.pause);
      this.pause = Math.min(LONGEST_PAUSE, this.pause * 2);
    };
  }

  /**
   * Ask something of the board.
   * @param {Record<string, unknown>} order
   */
  send(order) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(order));
  }
}
